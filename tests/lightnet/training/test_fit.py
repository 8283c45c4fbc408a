"""The training loop: exact resume, checks, early stop, steps that are not finite, folders of something else."""

from collections.abc import Iterator
from dataclasses import asdict, replace
from itertools import islice
from pathlib import Path

import pytest
import torch

from dataset_builder.errors import OutputError, UserError
from dataset_builder.lightnet.data.batch import Batch, Prediction
from dataset_builder.lightnet.data.lighting_dataset import measured
from dataset_builder.lightnet.measures.metrics import mean_metrics
from dataset_builder.lightnet.methods.baselines.pix2pix import Pix2Pix
from dataset_builder.lightnet.methods.checkpoint import build_method, load_state, load_trained, save_state
from dataset_builder.lightnet.methods.lightnet import LighTNet
from dataset_builder.lightnet.methods.method import Loss
from dataset_builder.lightnet.results.evaluate import contender, evaluate
from dataset_builder.lightnet.settings import load_training
from dataset_builder.lightnet.training.events import Checked, Event, Finished, Started, Stepped
from dataset_builder.lightnet.training.fit import TrainingJob, fit
from tests.lightnet.formula_method import write_checkpoint
from tests.lightnet.synthetic import PAPER_AND_ROUGH, write_synthetic

TINY = ("steps=6", "model={width: 4, downs: 2}", "data={crop: 32, batch: 2, workers: 0}",
        "check={every: 2, examples: 2}", "optimiser.warm_up=0")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_synthetic(tmp_path_factory.mktemp("data") / "set", levels=2)


def job(dataset: Path, out: Path, *overrides: str) -> TrainingJob:
    return TrainingJob(dataset=dataset, out=out, spec=load_training(None, [*TINY, *overrides]), device="cpu")


def run(job: TrainingJob) -> list[Event]:
    return list(fit(job))


def one(events: list[Event], kind: type[Event]) -> Event:
    (found,) = [event for event in events if isinstance(event, kind)]
    return found


def weights(job: TrainingJob, name: str = "last.pt") -> dict[str, torch.Tensor]:
    return load_state(job.out / name)["method"]


def same(one: dict[str, torch.Tensor], other: dict[str, torch.Tensor]) -> bool:
    return one.keys() == other.keys() and all(torch.equal(one[name], other[name]) for name in one)


@pytest.mark.parametrize("overrides", [(), ("method=pix2pix", "model={width: 2, downs: 6}")],
                         ids=["lightnet", "pix2pix"])
def test_an_interrupted_training_ends_with_the_same_weights(dataset: Path, tmp_path: Path,
                                                            overrides: tuple[str, ...]) -> None:
    """Pix2Pix has two optimisers, running statistics and, at six levels, dropout."""
    whole, broken = (job(dataset, tmp_path / name, *overrides) for name in ("whole", "broken"))
    assert not overrides or any(isinstance(part, torch.nn.Dropout) for part in build_method(whole.spec).modules())
    events = run(whole)
    # Stop in the middle, one step after the second checkpoint
    stopped = fit(broken)
    assert sum(isinstance(event, Stepped) for event in islice(stopped, 1 + 5 + 2)) == 5
    stopped.close()
    assert load_state(broken.out / "last.pt")["step"] == 4
    again = run(broken)
    assert one(again, Started).first == 4
    first, second = (load_state(part.out / "last.pt") for part in (whole, broken))
    assert same(first["method"], second["method"])
    assert first["history"] == second["history"]
    assert [event.loss for event in events if isinstance(event, Stepped)][4:] \
        == [event.loss for event in again if isinstance(event, Stepped)]
    assert (whole.out / "log.csv").read_bytes() == (broken.out / "log.csv").read_bytes()


def test_a_seed_repeats_and_another_one_does_not(dataset: Path, tmp_path: Path) -> None:
    first, again, other = (job(dataset, tmp_path / name, f"seed={seed}", "steps=2")
                           for name, seed in (("first", 7), ("again", 7), ("other", 8)))
    torch.manual_seed(1)
    run(first)
    torch.manual_seed(2)
    run(again)
    run(other)
    assert same(weights(first), weights(again))
    assert not same(weights(first), weights(other))


def test_readers_ahead_change_nothing(dataset: Path, tmp_path: Path) -> None:
    here, ahead = (job(dataset, tmp_path / name, "steps=2", f"data.workers={workers}")
                   for name, workers in (("here", 0), ("ahead", 1)))
    run(here)
    run(ahead)
    assert same(weights(here), weights(ahead))


def test_what_it_learns_shows(dataset: Path, tmp_path: Path) -> None:
    events = run(job(dataset, tmp_path / "out", "steps=40", "check.every=20", "optimiser.rate=3e-3"))
    losses = [event.loss["main"] for event in events if isinstance(event, Stepped)]
    # Seen to be 0.86 of it; at a rate of next to nothing it was 0.98 to 1.00
    assert sum(losses[-8:]) < 0.93 * sum(losses[:8])


def test_files_and_news(dataset: Path, tmp_path: Path) -> None:
    made = job(dataset, tmp_path / "out")
    events = run(made)
    started, finished = one(events, Started), one(events, Finished)
    assert started.parameters == {"main": sum(tensor.numel() for tensor in weights(made).values())}
    assert (started.train, started.held_out, started.first) == (6, 3, 0)
    assert [reason for reason in started.off if "fr" in reason]
    checks = [event for event in events if isinstance(event, Checked)]
    assert [check.step for check in checks] == [2, 4, 6]
    best = max(checks, key=lambda check: check.metrics["psnr"])
    assert finished.best == (best.step, best.metrics["psnr"])
    assert load_trained(finished.best_file, "cpu").step == best.step
    trained = load_trained(finished.last_file, "cpu")
    assert (trained.step, trained.spec) == (6, made.spec)
    assert not trained.method.training
    assert {path.name for path in made.out.iterdir()} == {"last.pt", "best.pt", "log.csv", "training.json",
                                                          "tensorboard"}
    assert len((made.out / "log.csv").read_text().splitlines()) == 1 + 3
    again = run(made)
    assert one(again, Finished).reason == "already" and not [event for event in again if isinstance(event, Stepped)]


def test_checks_say_what_noise_of_the_truth_does(tmp_path: Path) -> None:
    """By the same code as evaluations, for the same examples; the log has all figures."""
    data = write_synthetic(tmp_path / "set", train=4, held_out=2, size=40, layers=(*PAPER_AND_ROUGH, "i_t_se"))
    made = job(data, tmp_path / "out", "steps=2", "check={every: 2, examples: 0}")
    checked = one(run(made), Checked)
    held_out = measured(data, "evaluation", made.spec.data)
    rows = list(evaluate([contender("", load_trained(made.out / "last.pt", "cpu"))], held_out, range(len(held_out))))
    for part in ("metrics", "corrected", "ceiling"):
        wanted = asdict(mean_metrics([getattr(row, part) for row in rows]))
        assert getattr(checked, part) == pytest.approx(wanted, rel=1e-5)
    names, values = (made.out / "log.csv").read_text().split()
    logged = dict(zip(names.split(","), map(float, values.split(",")), strict=True))
    assert logged == pytest.approx({"step": 2.0, **checked.figures}, rel=1e-5)
    assert logged["psnr_ceiling"] > logged["psnr_corrected"] > logged["psnr"]


def test_noise_levels_are_chosen(dataset: Path, tmp_path: Path) -> None:
    events = run(replace(job(dataset, tmp_path / "out", "steps=1"), levels=(1,)))
    started = one(events, Started)
    assert (started.train, started.held_out) == (3, 1)


def test_training_alone_takes_the_rendered_image(tmp_path: Path) -> None:
    """Checks see the image of the field, as evaluations do, whatever is learnt from."""
    data = write_synthetic(tmp_path / "set", train=4, held_out=2, layers=(*PAPER_AND_ROUGH, "i_s_clean"))
    found = [run(job(data, tmp_path / name, f"data.i_s={name}", "steps=1", "optimiser.rate=1e-12"))
             for name in ("i_s", "i_s_clean")]
    assert one(found[0], Stepped).loss != one(found[1], Stepped).loss
    # At that rate weights stay where they began, so that checks differ if they see other images
    first, second = (one(events, Checked).metrics["psnr"] for events in found)
    assert first == pytest.approx(second, abs=1e-4)


def test_patience_ends_it(dataset: Path, tmp_path: Path) -> None:
    """At a rate of next to nothing, no check differs from the first, so that none is better."""
    made = job(dataset, tmp_path / "out", "steps=50", "check={every: 1, examples: 1, patience: 2}",
               "optimiser.rate=1e-30")
    events = run(made)
    finished = one(events, Finished)
    assert (finished.reason, finished.step, finished.best[0]) == ("patience", 3, 1)
    assert one(run(made), Finished).reason == "already"


class _Spoiling:
    """Makes LighTNet's loss NaN at some steps."""

    def __init__(self, steps: set[int]):
        self.steps, self.seen, self.loss = steps, 0, LighTNet.loss

    def __call__(self, method: LighTNet, phase: str, batch: Batch, prediction: Prediction) -> Loss:
        self.seen += 1
        loss = self.loss(method, phase, batch, prediction)
        return replace(loss, total=loss.total * float("nan")) if self.seen in self.steps else loss


@pytest.fixture
def spoiling(monkeypatch: pytest.MonkeyPatch) -> Iterator[_Spoiling]:
    spoil = _Spoiling({2, 3})
    monkeypatch.setattr(LighTNet, "loss", lambda *arguments: spoil(*arguments))
    yield spoil


def test_steps_that_are_not_finite_are_skipped(dataset: Path, tmp_path: Path, spoiling: _Spoiling) -> None:
    made = job(dataset, tmp_path / "out")
    events = run(made)
    assert [event.step for event in events if isinstance(event, Stepped) and event.skipped] == [2, 3]
    assert one(events, Finished).bad_steps == 2
    assert all(bool(torch.isfinite(tensor).all()) for tensor in weights(made).values())


def test_a_step_that_is_skipped_leaves_no_trace(dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Normalisation sees a batch before anybody knows that nothing is to be learnt from it."""
    loss = Pix2Pix.loss

    def spoilt(*arguments: object) -> Loss:
        found = loss(*arguments)
        return replace(found, total=found.total * float("nan"))

    monkeypatch.setattr(Pix2Pix, "loss", spoilt)
    made = job(dataset, tmp_path / "out", "method=pix2pix", "steps=1")
    assert one(run(made), Finished).bad_steps == 1
    assert same(weights(made), build_method(made.spec).state_dict())


def test_too_many_of_them_end_it(dataset: Path, tmp_path: Path, spoiling: _Spoiling) -> None:
    made = job(dataset, tmp_path / "out", "most_bad_steps=1")
    with pytest.raises(UserError, match="most_bad_steps: expected at most 1 steps with a non-finite loss or gradient, "
                                        "got 2"):
        run(made)
    assert load_state(made.out / "last.pt")["step"] == 2, "the checkpoint before stays"


def test_another_training_is_left_alone(dataset: Path, tmp_path: Path) -> None:
    made = job(dataset, tmp_path / "out", "steps=2")
    run(made)
    before = (made.out / "last.pt").read_bytes()
    for other in (job(dataset, made.out, "steps=4"), replace(made, levels=(0,))):
        with pytest.raises(OutputError, match="expected an earlier run of this training, got one with "):
            run(other)
    assert (made.out / "last.pt").read_bytes() == before


def test_what_another_training_differs_in_is_told(dataset: Path, tmp_path: Path) -> None:
    """But not what may change."""
    made = job(dataset, tmp_path / "out", "steps=2")
    run(made)
    with pytest.raises(OutputError, match=r"got one with steps 2 instead of 4, model\.width 4 instead of 8 \(choose"):
        run(job(dataset, made.out, "steps=4", "model.width=8", "data.workers=1"))
    with pytest.raises(OutputError, match="got one with another dataset, other VGG weights or another version"):
        run(replace(made, levels=(0,)))


def test_two_trainings_in_one_folder(dataset: Path, tmp_path: Path) -> None:
    made = job(dataset, tmp_path / "out")
    first = fit(made)
    assert isinstance(next(first), Started)
    for other in (made, job(dataset, made.out, "seed=1")):
        with pytest.raises(OutputError, match=r"out: another training is running in this folder \(process \d+\)"):
            run(other)
    assert not (made.out / "last.pt").exists()
    first.close()
    assert one(run(made), Finished).step == 6


def test_weights_of_vgg_that_are_not_there(dataset: Path, tmp_path: Path) -> None:
    for path in (tmp_path / "none.pth", tmp_path):
        with pytest.raises(UserError, match=r"expected a file, found none \(--vgg-weights takes"):
            run(replace(job(dataset, tmp_path / "out"), vgg_weights=path))
    assert not (tmp_path / "out").exists()


def test_what_decides_no_weight_may_change(dataset: Path, tmp_path: Path) -> None:
    """Who runs out of memory is told to take fewer readers, and who has too many bad steps may allow more."""
    made = job(dataset, tmp_path / "out", "steps=2")
    run(made)
    for change in ("data.workers=3", "data.verify=off", "most_bad_steps=99"):
        again = run(job(dataset, made.out, "steps=2", change))
        assert one(again, Finished).reason == "already"


@pytest.mark.parametrize("damage", [b"", b"no checkpoint", None])
def test_a_damaged_checkpoint_is_told(dataset: Path, tmp_path: Path, damage: bytes | None) -> None:
    made = job(dataset, tmp_path / "out", "steps=2")
    run(made)
    path = made.out / "last.pt"
    path.write_bytes(path.read_bytes()[:-100] if damage is None else damage)
    with pytest.raises(UserError, match=r"last\.pt: expected a checkpoint"):
        run(made)


def test_a_training_goes_on_from_its_best_checkpoint(dataset: Path, tmp_path: Path) -> None:
    """Where the last one was damaged; the first check is the best one here."""
    whole, broken = (job(dataset, tmp_path / name, "optimiser.rate=1e-30") for name in ("whole", "broken"))
    for made in (whole, broken):
        run(made)
    (broken.out / "last.pt").write_bytes((broken.out / "best.pt").read_bytes())
    assert one(run(broken), Started).first == 2
    assert same(weights(whole), weights(broken))
    assert (whole.out / "log.csv").read_bytes() == (broken.out / "log.csv").read_bytes()


def test_changed_bytes_are_not_taken_for_weights(dataset: Path, tmp_path: Path) -> None:
    """PyTorch reads them without a word."""
    made = job(dataset, tmp_path / "out", "steps=2")
    run(made)
    data = bytearray((made.out / "last.pt").read_bytes())
    place = data.index(next(tensor for tensor in weights(made).values() if tensor.numel() > 50).numpy().tobytes())
    data[place + 8:place + 12] = bytes(4)
    (made.out / "last.pt").write_bytes(data)
    assert torch.load(made.out / "last.pt", weights_only=True)["step"] == 2
    with pytest.raises(UserError, match=r"last\.pt: expected the bytes that were written, got others"):
        run(made)


def test_code_in_a_checkpoint_does_not_run(tmp_path: Path) -> None:
    class Bomb:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return (tmp_path / "struck").write_text, ("x",)

    torch.save({"format": "3df-lighting-training", "spec": Bomb()}, tmp_path / "bomb.pt")
    with pytest.raises(UserError, match="expected a checkpoint"):
        load_trained(tmp_path / "bomb.pt", "cpu")
    assert not (tmp_path / "struck").exists()


def test_a_checkpoint_is_used_without_the_losses_it_was_trained_on(tmp_path: Path) -> None:
    """FR alone: where it is used, there are no weights of VGG, and so no loss at all."""
    path = write_checkpoint(tmp_path / "last.pt")
    spec = load_training(None, ["model={width: 4, downs: 2}", "objective={dr: 0, fr: 1, dssim: 0, lab: 0}"])
    save_state(path, {**load_state(path), "spec": spec.model_dump_json()})
    assert load_trained(path, "cpu").spec == spec


@pytest.mark.parametrize(("override", "rule"), [
    ("data.train=trian", "trian"), ("data.held_out=test", "test")])
def test_a_split_that_is_not_there(dataset: Path, tmp_path: Path, override: str, rule: str) -> None:
    with pytest.raises(UserError, match=rule):
        run(job(dataset, tmp_path / "out", override))
    assert not (tmp_path / "out").exists()
