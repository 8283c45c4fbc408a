import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import fields
from itertools import islice
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
import torch

from dataset_builder.errors import ShardError, UserError
from dataset_builder.lightnet.data.augment import draws_of
from dataset_builder.lightnet.data.batch import Batch
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.data.loader import training_batches, whole_images
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.shards.reader import open_dataset
from tests.lightnet.synthetic import write_synthetic
from tests.shards.replaced import exr_of, replace_members

EXAMPLES, BATCH, STEPS = 5, 2, 9
ROOT = Path(__file__).parents[3]


def training(workers: int = 0, *, steps: int = STEPS, seed: int = 3, **data: object) -> TrainingSpec:
    """Nearly four epochs of five examples; batches that epochs do not divide into."""
    return TrainingSpec.model_validate({"seed": seed, "steps": steps, "data": {"batch": BATCH, "crop": 16,
                                                                               "workers": workers, **data}})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five examples; not to be changed."""
    return write_synthetic(tmp_path_factory.mktemp("loader") / "synthetic", train=EXAMPLES, held_out=2, size=24)


@pytest.fixture(scope="module")
def dataset(folder: Path) -> LightingDataset:
    """They, opened."""
    return LightingDataset(folder, "train", training().data)


def content(batch: Batch) -> tuple[bytes | tuple[str, ...], ...]:
    """All of a batch, bit by bit."""
    tensors = [tensor for part in (batch.inputs, batch.truth) for field in fields(part)
               if (tensor := getattr(part, field.name)) is not None]
    return (batch.keys, *(tensor.numpy().tobytes() for tensor in (batch.exposure, *tensors)))


def contents(batches: Iterator[Batch]) -> list[tuple[bytes | tuple[str, ...], ...]]:
    """All of several, each looked at after the last has come: what was handed out is left alone."""
    return [content(batch) for batch in list(batches)]


@pytest.fixture(scope="module")
def expected(dataset: LightingDataset) -> list[tuple[bytes | tuple[str, ...], ...]]:
    """What is read in this process."""
    return contents(training_batches(dataset, training(), multiple=8))


@pytest.mark.parametrize("workers", [1, 2])
def test_batches_are_the_same_bit_by_bit_whoever_reads(dataset: LightingDataset, workers: int,
                                                      expected: list[object]) -> None:
    assert contents(training_batches(dataset, training(workers), multiple=8)) == expected


def test_more_processes_than_cores_are_nobodys_warning(dataset: LightingDataset, expected: list[object],
                                                       monkeypatch: pytest.MonkeyPatch) -> None:
    """PyTorch prints two. Warnings are errors here."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
    assert contents(training_batches(dataset, training(2), multiple=8)) == expected


@pytest.mark.parametrize(("workers", "start"), [(0, 4), (1, 7), (2, 5), (0, STEPS), (1, STEPS)])
def test_a_training_goes_on_where_it_was(dataset: LightingDataset, workers: int, start: int,
                                         expected: list[object]) -> None:
    found = contents(training_batches(dataset, training(workers), multiple=8, start_step=start))
    assert found == expected[start:]


def test_batches_hold_what_the_order_says_varied_in_every_epoch(dataset: LightingDataset,
                                                                expected: list[tuple[object, ...]]) -> None:
    keys = [dataset.keys[draw.example] for step in range(STEPS)
            for draw in draws_of(step, size=BATCH, count=EXAMPLES, seed=3)]
    assert [key for batch in expected for key in batch[0]] == keys and len(set(map(str, expected))) == STEPS
    batches = list(training_batches(dataset, training(), multiple=8))
    pictures = {(key, batch.inputs.s_prime[i].numpy().tobytes()) for batch in batches for i, key in
                enumerate(batch.keys)}
    assert len(pictures) == STEPS * BATCH


def test_a_batch_depends_on_seed_and_step_alone(dataset: LightingDataset, expected: list[object]) -> None:
    longer = contents(islice(training_batches(dataset, training(steps=1000), multiple=8), STEPS))
    other = contents(training_batches(dataset, training(seed=4), multiple=8))
    assert longer == expected and not set(map(str, other)) & set(map(str, expected))


def test_what_is_drawn_elsewhere_neither_moves_a_batch_nor_is_moved(dataset: LightingDataset,
                                                                    expected: list[object]) -> None:
    for workers in (0, 1):
        torch.manual_seed(5)
        np.random.seed(5)
        found = contents(training_batches(dataset, training(workers), multiple=8))
        after = torch.rand(3), np.random.uniform(size=3)
        torch.manual_seed(5)
        np.random.seed(5)
        assert found == expected and torch.equal(after[0], torch.rand(3))
        assert np.array_equal(after[1], np.random.uniform(size=3))


@pytest.mark.parametrize(("crop", "multiple", "side"), [
    (16, 8, 16), (16, 1, 16), (999, 1, 24), (20, 8, 16), (16, 32, 32)])
def test_windows_are_as_large_as_asked_and_hold_the_object(dataset: LightingDataset, crop: int, multiple: int,
                                                           side: int) -> None:
    for batch in training_batches(dataset, training(crop=crop), multiple=multiple):
        shapes = {tuple(picture.shape) for picture in (batch.inputs.i_s, batch.inputs.s_prime, batch.truth.i_t,
                                                       batch.truth.d, batch.truth.r)}
        assert shapes == {(BATCH, 3, side, side)} and batch.inputs.inside.shape == (BATCH, 1, side, side)
        assert batch.inputs.inside.sum(dim=(1, 2, 3)).min() >= 1 and batch.inputs.sh.shape == (BATCH, 3, 9)
        assert not (batch.inputs.s_prime * (1 - batch.inputs.inside)).any()


def test_whole_images_are_the_examples_as_they_are(dataset: LightingDataset) -> None:
    found = list(whole_images(dataset, [4, 0, 4]))
    assert [content(batch) for batch in found] == [content(dataset[index]) for index in (4, 0, 4)]
    assert found[0].inputs.i_s.shape == (1, 3, 24, 24)


@pytest.fixture
def spoilt(folder: Path, tmp_path: Path) -> LightingDataset:
    """One of the five has a NaN."""
    own, key = Path(copytree(folder, tmp_path / "own")), "00000002"
    pixels = open_dataset(own)[key]["r"]
    pixels[5, 5, 1] = np.nan
    replace_members(own, {f"{key}.r.exr": exr_of(pixels, layer="r", key=key)})
    return LightingDataset(own, "train", training().data)


@pytest.mark.parametrize("workers", [0, 1, 2])
def test_what_is_wrong_with_an_example_comes_out_as_it_is_when_its_turn_comes(spoilt: LightingDataset,
                                                                              workers: int) -> None:
    turn = next(step for step in range(STEPS) if 2 in [draw.example for draw in
                                                       draws_of(step, size=BATCH, count=EXAMPLES, seed=3)])
    batches = training_batches(spoilt, training(workers), multiple=8)
    assert len(list(islice(batches, turn))) == turn
    with pytest.raises(ShardError) as caught:
        next(batches)
    problem, = caught.value.problems
    assert problem.where.startswith("synthetic-v1-train-000000-") and problem.path == "00000002.r.exr"
    assert str(caught.value) == str(problem) and "NaN" in problem.rule and "Traceback" not in problem.rule
    assert nobody_is_left()


def nobody_is_left(seconds: float = 10) -> bool:
    """Whether this process has no children any more, the server aside, which is not counted as one."""
    deadline = time.monotonic() + seconds
    while multiprocessing.active_children() and time.monotonic() < deadline:
        time.sleep(0.02)
    return not multiprocessing.active_children()


def test_processes_end_with_the_iterator(dataset: LightingDataset) -> None:
    batches = training_batches(dataset, training(2, steps=1000), multiple=8)
    assert next(batches) and len(multiprocessing.active_children()) == 2
    batches.close()
    assert nobody_is_left()
    assert len(list(training_batches(dataset, training(1), multiple=8))) == STEPS and nobody_is_left()


def test_a_process_that_dies_is_told_with_a_remedy(dataset: LightingDataset) -> None:
    batches = training_batches(dataset, training(1, steps=10_000), multiple=8)
    next(batches)
    multiprocessing.active_children()[0].kill()
    with pytest.raises(UserError, match=r"data\.workers: a process that reads ahead died .*set `data.workers` to 0"):
        for _ in batches:
            pass
    assert nobody_is_left()


SCRIPT = """
import signal
import sys
from pathlib import Path
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.data.loader import training_batches
from dataset_builder.lightnet.settings import TrainingSpec

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    spec = TrainingSpec.model_validate({"steps": 10**6, "data": {"batch": 2, "crop": 16, "workers": 2}})
    dataset = LightingDataset(Path(sys.argv[1]), "train", spec.data)
    try:
        for batch in training_batches(dataset, spec, multiple=8):
            print("ready", flush=True)
    except KeyboardInterrupt:
        sys.exit(130)
"""


@pytest.mark.skipif(not os.path.isdir("/proc"), reason="processes are looked up in /proc")
@pytest.mark.parametrize(("end", "code"), [(signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)])
def test_ctrl_c_and_worse_leave_no_process(folder: Path, tmp_path: Path, end: signal.Signals, code: int) -> None:
    """Ctrl-C reaches every process of a terminal; a kill only the first."""
    (tmp_path / "script.py").write_text(SCRIPT)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(tmp_path / "script.py"), str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment,
                          start_new_session=True) as process:
        assert process.stdout is not None and process.stderr is not None
        assert process.stdout.readline() == b"ready\n" and len(session(process.pid)) >= 4
        if end == signal.SIGINT:
            os.killpg(process.pid, end)
        else:
            process.kill()
        assert process.wait(30) == code
        said = process.stderr.read().decode()
    # Python's tracker of resources remarks on a kill, which nobody can clean up after
    assert end == signal.SIGKILL or said == ""
    deadline = time.monotonic() + 10
    while session(process.pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not session(process.pid)


def session(leader: int) -> list[int]:
    """Processes of a session, but for those that have ended."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                state, _, _, its = (entry / "stat").read_text().rpartition(")")[2].split()[:4]
            except OSError:
                continue
            if int(its) == leader and state != "Z":
                found.append(int(entry.name))
    return found
