"""How good methods are, example by example: trained ones beside three untrained baselines.

All see the same whole frames and are measured on the same pixels, so that their figures may be subtracted. Examples of
one object resemble each other; a row therefore says what it shows, and `results.clustered_means` counts objects.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from math import isnan
from pathlib import Path
from time import perf_counter

import torch

from dataset_builder.errors import Problem, UserError
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.lightnet.data.batch import Batch, Prediction
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.data.loader import whole_images
from dataset_builder.lightnet.measures.metrics import Metrics, measure
from dataset_builder.lightnet.measures.truth_noise import UNKNOWN, NoisyTruth, noise_of
from dataset_builder.lightnet.methods.checkpoint import Trained, load_trained
from dataset_builder.lightnet.methods.method import TRIVIAL, count_parameters, predict
from dataset_builder.lightnet.settings import DataSpec

CPU = torch.device("cpu")
FORMULAS = {"copy_i_s": "I_s as it is", "d_s_prime": "D S' with the true D",
            "dr_s_prime": "(D + R) S' with the true D and R"}
COMPARABLE = ("inside", "source_exposure")
"""Values of `data` that change what is measured; methods compared with each other share them."""


@dataclass(frozen=True, kw_only=True)
class Contender:
    """Something that predicts."""

    name: str
    find: Callable[[Batch], Prediction]
    """From a batch on `device` to what it holds for I_t."""
    device: torch.device = CPU
    trained: bool = False
    note: str = ""
    """What it is, for people."""


@dataclass(frozen=True, kw_only=True)
class ScoreRow:
    """One example by one method."""

    method: str
    key: str
    view: str
    object: str
    """Name, unique over the dataset."""
    room: str
    """Name, unique over the dataset."""
    level: int
    """Of the rough mesh's noise."""
    sigma: float
    """Of the rough mesh's noise; 0 where it is taken from a field."""
    rough: str = ""
    """Name of the rough mesh's level or field, where it has one."""
    metrics: Metrics
    seconds: float
    """From inputs in memory to the prediction."""
    corrected: Metrics = UNKNOWN
    """Estimate of what `metrics` would be against truth without noise; NaN where nobody knows the noise."""
    ceiling: Metrics = UNKNOWN
    """What a perfect prediction would have, against the truth as it is; the same for all methods."""

    @property
    def noise_known(self) -> bool:
        """Whether the noise of the truth is known."""
        return not isnan(self.ceiling.psnr)


def trivial() -> list[Contender]:
    """The contenders that learn nothing; two of them are told the true D and R."""
    return [Contender(name=name, find=partial(_by_formula, formula), note=f"{FORMULAS[name]}; untrained")
            for name, formula in TRIVIAL.items()]


def load_all(checkpoints: Sequence[Path], device: str = "auto") -> dict[str, Trained]:
    """The methods of checkpoints by names that differ: the method's, with its folder's where that is not enough.

    Raises UserError where a file is no checkpoint, or where two were trained on other pixels or exposures.
    """
    loaded = {path: load_trained(path, device) for path in dict.fromkeys(checkpoints)}
    first = next(iter(loaded.values()))
    for path, trained in loaded.items():
        _require_same_data(path, trained.spec.data, first.spec.data)
    return dict(zip(_names(loaded), loaded.values(), strict=True))


def contender(name: str, trained: Trained) -> Contender:
    """A trained method as a contender."""
    note = "; ".join([f"{count_parameters(trained.method):,} parameters, {trained.step} steps on {trained.dataset}",
                      *trained.off])
    return Contender(name=name, find=lambda batch: predict(trained.method, batch.inputs), device=trained.device,
                     trained=True, note=note)


def evaluate(contenders: Sequence[Contender], dataset: LightingDataset, indices: Sequence[int]) -> Iterator[ScoreRow]:
    """One row for each example, by position in the dataset, and contender; all contenders of an example in turn.

    Trained methods run once beforehand, so that nobody's seconds hold what only happens once.
    """
    for index, batch in zip(indices, whole_images(dataset, indices), strict=True):
        noise = noise_of(batch)
        for one in contenders:
            moved = batch.to(one.device)
            if one.trained and index == indices[0]:
                one.find(moved)
            yield row(one, moved, dataset.label(index).plan, noise)[0]


def row(one: Contender, batch: Batch, plan: ExamplePlan,
        noise: NoisyTruth | None = None) -> tuple[ScoreRow, Prediction]:
    """The row of one example and what was predicted: a batch of one, on the contender's device, its plan, and its
    truth's noise."""
    prediction, seconds = timed(one, batch)
    told = {} if noise is None else {"corrected": noise.corrected(prediction.i_t), "ceiling": noise.ceiling}
    metrics, = measure(prediction.i_t, batch.truth.i_t, batch.inputs.inside)
    return ScoreRow(method=one.name, key=batch.keys[0], view=plan.view, object=plan.target.object.name,
                    room=plan.room.name, level=plan.rough.level, sigma=plan.rough.sigma, rough=plan.rough.name,
                    metrics=metrics, seconds=seconds, **told), prediction


def timed(one: Contender, batch: Batch) -> tuple[Prediction, float]:
    """A prediction and the seconds that it took."""
    _wait(one.device)
    begin = perf_counter()
    prediction = one.find(batch)
    _wait(one.device)
    return prediction, perf_counter() - begin


def _wait(device: torch.device) -> None:
    """A GPU works on after Python has gone on."""
    if device.type == "cuda":
        torch.cuda.synchronize(device)


def _by_formula(formula: Callable[[Batch], torch.Tensor], batch: Batch) -> Prediction:
    return Prediction(i_t=formula(batch))


def _names(loaded: dict[Path, Trained]) -> list[str]:
    """Method names; with the checkpoint's folder, and then its file, for those that are not alone with theirs."""
    names = [trained.name for trained in loaded.values()]
    for part in (lambda path: path.absolute().parent.name, lambda path: path.name):
        count = Counter(names)
        names = [f"{name} {part(path)}" if count[name] > 1 else name for name, path in zip(names, loaded, strict=True)]
    return [name if names.count(name) == 1 else str(path) for name, path in zip(names, loaded, strict=True)]


def _require_same_data(path: Path, data: DataSpec, first: DataSpec) -> None:
    for key in COMPARABLE:
        if (got := getattr(data, key)) != (expected := getattr(first, key)):
            raise UserError([Problem(where=str(path), path=f"data.{key}",
                                     rule=f"expected {expected}, as the first checkpoint was trained with, got {got}",
                                     hint="evaluate it separately")])
