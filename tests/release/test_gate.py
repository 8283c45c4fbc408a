"""The release gate: its parts in order, what makes each say no, and that a no is told with its reason."""

import json
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from dataset_builder.cli import inspect
from dataset_builder.cli.main import main
from dataset_builder.errors import ShardError
from dataset_builder.lightnet.data.batch import Batch, Inputs, Truth
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.measures.metrics import Metrics
from dataset_builder.lightnet.results.evaluate import ScoreRow
from dataset_builder.lightnet.settings import DataSpec, load_training
from dataset_builder.release.gate import PARTS, Begun, Done, Gate, LeftOut, run
from dataset_builder.release.training_checks import SETTINGS, STEPS, compare, loader_checks, read
from dataset_builder.shards.manifest import Manifest, from_json, to_json
from tests.lightnet.synthetic import write_synthetic
from tests.shards.test_verify import reseal
from tools.sabotage import sabotage

TINY = ("steps=2", "model={width: 4, downs: 2}", "data={crop: 32, batch: 2, workers: 0}",
        "check={every: 9, examples: 1}")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_synthetic(tmp_path_factory.mktemp("data") / "set", train=20, held_out=6, size=64, levels=2)


def gate(dataset: Path, out: Path, **changes: object) -> Gate:
    whole = Gate(dataset=dataset, out=out, spec=load_training(None, TINY), parts=tuple(PARTS), margin=-100,
                 copy_margin=-100, device="cpu")
    return replace(whole, **changes)  # type: ignore[arg-type]


def done(gate: Gate) -> dict[str, Done]:
    return {news.part: news for news in run(gate) if isinstance(news, Done)}


def refused(one: Done) -> set[str]:
    return {check.name for check in one.found.checks if not check.holds}


def test_all_parts_run_in_order(dataset: Path, tmp_path: Path) -> None:
    """Two steps teach nothing, so that no margin can be asked for, and chance decides what is clear."""
    news = list(run(gate(dataset, tmp_path)))
    assert [one.part for one in news if isinstance(one, Begun)] == list(PARTS)
    found = {one.part: one for one in news if isinstance(one, Done)}
    assert all(found[part].holds for part in ("files", "consistency", "loader"))
    assert not [name for name in refused(found["training"]) if name.startswith("beats_")]
    assert len(found["training"].found.checks) == 7 and len(found["training"].found.rows) == 4 * 6
    assert len(found["consistency"].found.facts) == 26 and all(one.seconds > 0 for one in found.values())


def test_what_comes_after_a_no_is_left_out_and_told(dataset: Path, tmp_path: Path) -> None:
    sabotage(dataset, tmp_path / "spoilt", "gamma_i_t")
    news = list(run(gate(tmp_path / "spoilt", tmp_path, parts=("loader", "consistency", "files"))))
    assert [one.part for one in news if isinstance(one, Done)] == ["files", "consistency"]
    assert isinstance(news[-1], LeftOut) and news[-1].parts == ("loader",)
    assert "light_slope" in refused(next(one for one in news if isinstance(one, Done) and one.part == "consistency"))
    everything = done(gate(tmp_path / "spoilt", tmp_path, stop=False, parts=("files", "consistency", "loader")))
    assert list(everything) == ["files", "consistency", "loader"]


def test_files_that_changed_are_refused_with_the_reason(dataset: Path, tmp_path: Path) -> None:
    shutil.copytree(dataset, tmp_path / "set")
    (tmp_path / "set" / "README.md").write_text("changed")
    found = done(gate(tmp_path / "set", tmp_path))
    assert list(found) == ["files"] and "README.md: expected SHA-256" in found["files"].found.checks[0].detail
    found = done(gate(tmp_path / "nothing", tmp_path))
    assert "expected a finished dataset" in found["files"].found.problems[0]


def test_a_part_that_cannot_read_says_no(dataset: Path, tmp_path: Path) -> None:
    spec = load_training(None, [*TINY, "data.held_out=test"])
    found = done(gate(dataset, tmp_path, spec=spec, parts=("loader", "training"), stop=False))
    for one in found.values():
        assert refused(one) == {"reads"} and "expected test, got train, evaluation" in one.found.problems[0]


def test_the_loader_counts_what_the_manifest_promises(dataset: Path, tmp_path: Path) -> None:
    found = {check.name: check for check in loader_checks(dataset, DataSpec())}
    assert all(check.holds for check in found.values()) and found["counted"].detail.startswith("train 20, evaluation 6")
    shutil.copytree(dataset, tmp_path / "set")
    manifest = from_json(Manifest, (dataset / "dataset.json").read_bytes(), where="")
    more = manifest.splits[0].model_copy(update={"examples": 22})
    (tmp_path / "set" / "dataset.json").write_bytes(to_json(manifest.model_copy(update={
        "splits": (more, manifest.splits[1])})))
    reseal(tmp_path / "set")
    with pytest.raises(ShardError, match="expected 22 examples in split train, its shards hold 20"):
        loader_checks(tmp_path / "set", DataSpec())


def test_tensors_that_teach_nothing_are_seen(dataset: Path) -> None:
    batch = LightingDataset(dataset, "train", DataSpec())[0]
    assert read(batch).finite and read(batch).lighting and read(batch).inside > 100
    bad = batch.truth.i_t.clone()
    bad[0, 1, 3, 4] = float("nan")
    assert not read(replace(batch, truth=replace(batch.truth, i_t=bad))).finite
    negative = replace(batch, inputs=replace(batch.inputs, s_prime=batch.inputs.s_prime - 1))
    assert not read(negative).finite
    for sh in (batch.inputs.sh[:, :, :4], batch.inputs.sh * 0, batch.inputs.sh * float("inf")):
        assert not read(replace(batch, inputs=replace(batch.inputs, sh=sh))).lighting


def rows(leads: Sequence[float], views: Sequence[str], method: str = "lightnet") -> list[ScoreRow]:
    """A method that is ahead of every rival by `leads`, dB."""
    made = []
    for number, (lead, view) in enumerate(zip(leads, views, strict=True)):
        for name, psnr in ((method, 20 + number + lead), ("copy_i_s", 20.0 + number), ("d_s_prime", 20.0 + number),
                           ("dr_s_prime", 20.0 + number)):
            made.append(ScoreRow(method=name, key=str(number), view=view, object="o", room="r", level=0, sigma=0.0,
                                 metrics=Metrics(l1=0, psnr=psnr, ssim=0, lab=0), seconds=0))
    return made


def verdicts(leads: Sequence[float], views: Sequence[str] = "abcdef", **margins: float) -> dict[str, bool]:
    asked = {"margin": 0.5, "copy_margin": 3.0, **margins}
    return {check.name: check.holds for check in compare(rows(leads, views), "lightnet", **asked) if check.judged}


def test_a_lead_must_be_long_and_sure() -> None:
    assert all(verdicts([4, 4.5, 5, 3.9, 4.1, 4.2]).values())
    short = verdicts([0.6, 0.7, 0.65, 0.6, 0.7, 0.6])
    assert not short["beats_copy_i_s"] and short["beats_d_s_prime"] and short["clearly_copy_i_s"]
    assert verdicts([0.6, 0.7, 0.65, 0.6, 0.7, 0.6], copy_margin=0.5)["beats_copy_i_s"]
    chance = verdicts([9, -5, 8, -4, 7, -3])
    assert chance["beats_d_s_prime"] and not chance["clearly_d_s_prime"]
    assert not any(verdicts([-4, -4.1, -4.2, -4, -4, -4]).values())


def test_examples_of_one_view_count_as_one() -> None:
    """Leads of 2 and 0 dB: twelve examples are clear, two views are not."""
    leads = [2.0, 0.0] * 6
    assert verdicts(leads, [str(number) for number in range(12)])["clearly_d_s_prime"]
    assert not verdicts(leads, ["even", "odd"] * 6)["clearly_d_s_prime"]
    assert not verdicts([5.0] * 4, ["same"] * 4)["clearly_d_s_prime"]


def test_one_view_has_no_error_and_that_is_said() -> None:
    clear = next(check for check in compare(rows([5.0] * 4, ["same"] * 4), "lightnet", margin=0.5, copy_margin=3.0)
                 if check.name == "clearly_d_s_prime")
    assert clear.detail == "+5.00 dB, 4 examples, all of one view: no standard error over views"


def test_a_lead_that_is_no_number_is_no_lead() -> None:
    assert not any(verdicts([float("nan"), 5, 5, 5, 5, 5]).values())


def test_the_verb_writes_a_report_and_exits_by_it(dataset: Path, tmp_path: Path,
                                                  capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["validate", str(dataset), "--only", "files,consistency", "--out", str(tmp_path / "good")]) == 0
    assert "passed: files, consistency" in capsys.readouterr().out
    sabotage(dataset, tmp_path / "spoilt", "shift_mask_cut")
    assert main(["validate", str(tmp_path / "spoilt"), "--out", str(tmp_path / "bad")]) == 1
    text = capsys.readouterr().out
    assert "failed: support: share of pixels" in text and "expected <= 0.01, got" in text and "not run" in text
    report = json.loads((tmp_path / "bad" / "report.json").read_bytes())
    assert not report["holds"] and report["not_run"] == ["loader", "training"]
    page = (tmp_path / "bad" / "report.md").read_text()
    for figure in ("figures/light.png", "figures/mask.png"):
        assert figure in page and (tmp_path / "bad" / figure).stat().st_size > 1000


def test_a_whole_run_with_a_training_has_its_figure(dataset: Path, tmp_path: Path,
                                                    capsys: pytest.CaptureFixture[str]) -> None:
    """What stands in `out` from an earlier run is replaced; a margin beyond reach is a no."""
    arguments = ["validate", str(dataset), "--only", "training", "--out", str(tmp_path), "--margin", "50",
                 *(part for setting in TINY for part in ("--set", setting)), "--device", "cpu"]
    for _ in range(2):
        assert main(arguments) == 1
        assert "failed: beats_d_s_prime" in capsys.readouterr().out
    assert (tmp_path / "figures" / "training.png").stat().st_size > 1000
    (tmp_path / "training" / "training.json").unlink()
    assert main(arguments) == 1
    assert "expected an earlier training or nothing" in capsys.readouterr().out


def test_parts_are_known_by_name(dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert tuple(PARTS) == inspect.PARTS
    for only in ("files,nonsense", ""):
        assert main(["validate", str(dataset), "--only", only]) == 2
        assert "--only: expected some of files, consistency" in capsys.readouterr().err
    assert load_training(None, [f"steps={STEPS}", *SETTINGS]).steps == STEPS


def test_a_batch_without_an_object_is_seen() -> None:
    image, nothing = torch.zeros(1, 3, 8, 8), torch.zeros(1, 1, 8, 8)
    batch = Batch(keys=("a",), exposure=torch.ones(1), truth=Truth(i_t=image, d=image, r=image),
                  inputs=Inputs(i_s=image, s_prime=image, inside=nothing, sh=torch.from_numpy(np.ones((1, 3, 9)))))
    assert read(batch).inside == 0
