"""Fields, splats, hard cases of every effect, a training and memory, on the device."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.lightnet.settings import load_training
from dataset_builder.lightnet.training.events import Stepped
from dataset_builder.lightnet.training.fit import TrainingJob, fit
from dataset_builder.studies.stress.cases import CASES
from tests.gpu.conftest import Side, run_module
from tests.lightnet.synthetic import write_synthetic

pytestmark = pytest.mark.gpu
MIB = 2**20
SLACK = 64 * MIB
"""Memory that a process may take once more, after a third of its work."""
TRAINING = ("steps=60", "model={width: 8, downs: 2}", "data={crop: 32, batch: 4, workers: 0}",
            "check={every: 60, examples: 2}", "optimiser.warm_up=0")


def fields(backend: str, folder: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    run_module("tests.gpu.field_side", backend, str(folder / f"{backend}.npz"), fault=True)
    with np.load(folder / f"{backend}.npz") as found:
        return json.loads(str(found["figures"])), {name: found[name] for name in found.files if name != "figures"}


@pytest.fixture(scope="module")
def on_device(device: str, tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    return fields(device, tmp_path_factory.mktemp("device"))


@pytest.fixture(scope="module")
def on_cpu(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    return fields("llvm", tmp_path_factory.mktemp("cpu"))


@pytest.mark.parametrize(("figure", "apart"), [("psnr", 1.0), ("opacity_iou", 0.02), ("silhouette_iou", 0.02)])
def test_a_fit_is_as_good(on_cpu, on_device, figure: str, apart: float) -> None:
    """Rounding and the order of sums lead a fit elsewhere, but not to another quality."""
    cpu, device = (side[0][figure][0] for side in (on_cpu, on_device))
    assert device == pytest.approx(cpu, abs=apart), f"{figure} of a density field"


def test_a_fit_repeats_byte_for_byte(on_device) -> None:
    first, second = on_device[0]["digests"]
    assert first == second, "a density field fitted twice on one device"


@pytest.mark.parametrize("what", ["light", "opacity", "depth"])
def test_splats_look_the_same(on_cpu, on_device, what: str) -> None:
    """No random numbers: a ray in fifty may meet splats in another order, by rounding."""
    off = np.abs(on_cpu[1][what] - on_device[1][what]).reshape(len(on_cpu[1][what]), -1).max(axis=1)
    assert np.mean(off > 1e-3) <= 0.02, f"splats, {what}: {np.mean(off > 1e-3):.1%} of the rays differ"


@pytest.fixture(scope="module", params=["camera", "joined"])
def cases(request: pytest.FixtureRequest, device: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Results of every hard case on the device, by transport."""
    table = tmp_path_factory.mktemp("cases") / "table.csv"
    try:
        run_module("dataset_builder", "stress", "--size", "small", "--backend", device, "--transport", request.param,
                   "--csv", str(table))
    except AssertionError:
        # Cases that fail make the verb fail; the table says which
        assert table.exists()
    with table.open(encoding="utf-8", newline="") as stream:
        return {row["case"]: row for row in csv.DictReader(stream)}


@pytest.mark.parametrize("case", [case.name for case in CASES])
def test_hard_cases_pass(cases: dict[str, Any], case: str) -> None:
    """Every light, material and kind of geometry against a law or a formula, see docs/stress.md."""
    row = cases[case]
    assert row["passed"] == "1", (f"{case}: measured {row['measured']}, bound {row['bound']} ({row['figure']}); "
                                  f"{row['wrong']}")


def test_many_views_take_no_more_memory_than_a_few(sides: tuple[Side, Side]) -> None:
    used = sides[1].figures["many"]["used"]
    begin, end = max(used[:len(used) // 3]), max(used[2 * len(used) // 3:])
    assert end <= begin + SLACK, f"memory grew from {begin / MIB:.0f} to {end / MIB:.0f} MiB over {len(used)} examples"


def test_memory_that_runs_out_ends_with_a_reason(device: str) -> None:
    if device != "cuda":
        pytest.skip("a CPU's memory must not be exhausted by a test")
    assert "expected enough memory on the GPU" in run_module("tests.gpu.exhaust")


def test_training_gets_better_in_bounded_memory(device: str, tmp_path: Path) -> None:
    import torch

    where = "cuda" if device == "cuda" else "cpu"
    if where == "cuda" and not torch.cuda.is_available():
        pytest.skip("this PyTorch has no CUDA (docs/training.md)")
    data = write_synthetic(tmp_path / "set", levels=2)
    job = TrainingJob(dataset=data, out=tmp_path / "out", spec=load_training(None, list(TRAINING)), device=where)
    losses, used = [], []
    for event in fit(job):
        if isinstance(event, Stepped):
            losses.append(event.loss)
            used.append(torch.cuda.memory_allocated() if where == "cuda" else 0)
    assert np.mean(losses[-10:]) < 0.9 * np.mean(losses[:10]), "the loss of a training of 60 steps"
    assert max(used[40:]) <= max(used[:20]) + SLACK, "memory of a training"
