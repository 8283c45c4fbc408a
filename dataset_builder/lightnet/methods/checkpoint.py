"""Methods with their first weights, and checkpoints: all that a training needs to resume as if it had never stopped.

A checkpoint is one file, complete or absent. It holds plain data and tensors only and is read with `weights_only`,
so that one from elsewhere may be wrong but cannot run code.
"""

import pickle
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

import torch
from pydantic import ValidationError

from dataset_builder.errors import Problem, UserError
from dataset_builder.files import write_atomic
from dataset_builder.lightnet.methods.baselines.dpr import Dpr
from dataset_builder.lightnet.methods.baselines.pix2pix import Pix2Pix
from dataset_builder.lightnet.methods.baselines.ssvbrdf import Ssvbrdf
from dataset_builder.lightnet.methods.lightnet import LighTNet
from dataset_builder.lightnet.methods.losses import LightObjective
from dataset_builder.lightnet.methods.method import Method, choose
from dataset_builder.lightnet.settings import ObjectiveSpec, TrainingSpec
from dataset_builder.seeding import derive_seed

FORMAT = "3df-lighting-training"
VERSION = 1
KEYS = {"format", "version", "spec", "identity", "dataset", "step", "method", "optimisers", "history", "best",
        "bad_steps", "stale", "off"}
ANOTHER = "best.pt and last.pt have the same format: replace the damaged file with a copy of the other"


def build_method(spec: TrainingSpec, vgg_weights: Path | None = None) -> Method:
    """The method that a spec names, on the CPU. Its first weights depend on the spec's seed, method and model alone;
    the global random state is left as it was.

    vgg_weights: file of VGG-19, for the objective of LighTNet. Raises UserError where it is not what it should be.
    """
    # Nothing on a GPU draws weights, so the states of GPUs need not be kept
    with torch.random.fork_rng(devices=[]):
        torch.default_generator.manual_seed(derive_seed(spec.seed, "weights"))
        return _BUILDERS[spec.method](spec, vgg_weights)


_BUILDERS: dict[str, Callable[[TrainingSpec, Path | None], Method]] = {
    "lightnet": lambda spec, vgg_weights: LighTNet(spec.model, LightObjective(spec.objective, vgg_weights)),
    "pix2pix": lambda spec, _: Pix2Pix(spec.model),
    "dpr": lambda spec, _: Dpr(spec.model),
    "ssvbrdf": lambda spec, _: Ssvbrdf(spec.model),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Trained:
    """A method ready for use, in evaluation mode on `device`."""

    method: Method
    spec: TrainingSpec
    step: int
    """Batches that it was trained on."""
    dataset: str
    """Name of what it was trained on."""
    off: tuple[str, ...]
    """Losses that were off, and why."""
    device: torch.device

    @property
    def name(self) -> str:
        """What tables call it."""
        return self.spec.method


def save_state(path: Path, state: dict[str, Any]) -> None:
    """Write a training's state. Raises OutputError where the disk refuses; the file before it stays then."""
    stream = BytesIO()
    torch.save({"format": FORMAT, "version": VERSION, **state}, stream)
    write_atomic(path, stream.getvalue())


def load_state(path: Path) -> dict[str, Any]:
    """A training's state, its tensors on the CPU. Raises UserError where the file is none of ours or damaged."""
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
        # PyTorch takes changed bytes for numbers; the archive has checksums
        with ZipFile(path) as archive:
            damaged = archive.testzip()
    except FileNotFoundError as error:
        raise _wrong(path, "expected a checkpoint, found no file") from error
    except OSError as error:
        raise _wrong(path, f"expected a readable file, got: {error.strerror or error}") from error
    except (RuntimeError, pickle.UnpicklingError, EOFError, ValueError, KeyError, TypeError, BadZipFile) as error:
        raise _wrong(path, "expected a checkpoint, got a file that cannot be read as one: truncated, or of another "
                           "kind",
                     ANOTHER) from error
    if damaged:
        raise _wrong(path, "expected the bytes that were written, got others: the file was damaged on disk or in "
                           "transfer",
                     ANOTHER)
    if not isinstance(state, dict) or state.get("format") != FORMAT:
        raise _wrong(path, "expected a checkpoint of `dataset-builder train`, got another kind of file")
    if state.get("version") != VERSION or set(state) != KEYS:
        raise _wrong(path, f"expected a checkpoint of version {VERSION}, got one of version {state.get('version')}",
                     "train again with this version")
    return state


def load_trained(path: Path, device: str = "auto") -> Trained:
    """The method of a checkpoint. Raises UserError as `load_state` does, or where its weights fit no such method."""
    state, where = load_state(path), choose(device)
    spec = spec_of(state, path)
    # Losses are not needed any more, and neither are the weights of VGG
    method = build_method(spec.model_copy(update={"objective": ObjectiveSpec(fr=0)}))
    load_weights(method, state["method"], path)
    return Trained(method=method.to(where).eval(), spec=spec, step=state["step"], dataset=state["dataset"],
                   off=tuple(state["off"]), device=where)


def spec_of(state: dict[str, Any], path: Path) -> TrainingSpec:
    """How the training of a state is done. Raises UserError where this version knows no such spec."""
    try:
        return TrainingSpec.model_validate_json(state["spec"])
    except ValidationError as error:
        raise _wrong(path, "expected a configuration of this version of the package, got one of another version",
                     "train again with this version") from error


def load_weights(method: Method, weights: dict[str, torch.Tensor], path: Path) -> None:
    """Give a method its trained weights. Raises UserError where they are of another shape or name."""
    try:
        method.load_state_dict(weights)
    except RuntimeError as error:
        raise _wrong(path, "expected weights that fit the method of its spec, got others",
                     "it was written by another version of this package: train again") from error


def _wrong(path: Path, rule: str, hint: str = "") -> UserError:
    return UserError([Problem(where=str(path), path="", rule=rule, hint=hint)])
