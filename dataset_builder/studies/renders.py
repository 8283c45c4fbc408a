"""Renderings of single planned examples: timed without compiling kernels, and converged ones kept beside a study."""

import importlib.metadata
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from dataset_builder.digest import digest
from dataset_builder.engine.field_tasks import passing_shelf
from dataset_builder.engine.source import source_digest
from dataset_builder.files import write_atomic
from dataset_builder.label.example_label import RenderRecord
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.layers import LAYERS
from dataset_builder.rendering.backend import active, renderer_versions
from dataset_builder.rendering.examples import Rendered, render_view
from dataset_builder.rendering.pass_inputs import DIRECT
from dataset_builder.studies.sampled import rerendered

STEADY = 0.9
"""Share of the time that a repetition must save for another one to be worth it."""

REPEATS = 3
TINY = 12
"""Pixels along a side of what is rendered for its kernels alone."""
DENOISE = "denoise"
"""What the denoiser's time is called in `Rendered.seconds`."""
PIXELS = ("rendering.examples", "rendering.backend")
"""What turns a plan into pixels: reports may change without a reference being lost."""


def render(plan: ExamplePlan, mesh_root: Path) -> Rendered:
    """One example; `rendering.backend.activate` must have run in this process. Fields that it needs are made and kept
    as long as the process lives."""
    return next(render_view([plan], mesh_root, fields=passing_shelf([plan], mesh_root, active())))


def timed(plan: ExamplePlan, mesh_root: Path, repeats: int = REPEATS) -> Rendered:
    """One example with the least time of every pass out of up to `repeats` runs: until one saves next to nothing.

    What else the machine does, and kernels that were not compiled after all, only ever add.
    """
    found = render(plan, mesh_root)
    for _ in range(repeats - 1):
        before, again = sum(found.seconds.values()), render(plan, mesh_root).seconds
        found.seconds.update({name: min(seconds, again[name]) for name, seconds in found.seconds.items()})
        if sum(again.values()) >= STEADY * before:
            break
    return found


@dataclass(frozen=True)
class Warm:
    """Which kernels are compiled already. A kernel depends on features, layers and spp, not on the size of the image,
    so that a tiny one compiles them all."""

    done: set[Hashable] = field(default_factory=set)

    def up(self, setting: str, plan: ExamplePlan, mesh_root: Path) -> None:
        """Compile what rendering `plan` needs, where no plan like it was met under this setting before."""
        key = (setting, plan.effects.features, plan.render.layers)
        if key not in self.done:
            render(rerendered(plan, width=TINY, height=TINY), mesh_root)
            self.done.add(key)


def seconds_of(layer: str, found: Rendered, times: Mapping[str, float] | None = None) -> float:
    """Seconds of the pass that makes a layer, and of its share of denoising where that was asked for. times: by pass,
    the wall's unless given."""
    denoised, spent = found.plan.render.denoise, found.seconds if times is None else times
    share = spent.get(DENOISE, 0.0) / len(denoised) if layer in denoised else 0.0
    if layer == "s_prime":
        share += spent.get(DIRECT, 0.0)
    return spent.get(LAYERS[layer].render_pass, 0.0) + share


def work_of(layer: str, record: RenderRecord) -> dict[str, float]:
    """Mean, least and most spp, and paths, of the pass that makes a layer."""
    entry = next(entry for entry in record.passes if entry.name == LAYERS[layer].render_pass)
    return {name: float(getattr(entry, name)) for name in ("spp", "spp_min", "spp_max", "paths")}


def reached_by(layer: str, record: RenderRecord) -> float:
    """The relative error that the record claims for a layer: root mean square over the object's pixels."""
    return next((entry.relative_error for entry in record.layers if entry.name == layer), 0.0)


def unknown_in(layer: str, record: RenderRecord) -> bool:
    """Whether the record says that a layer's mean is not known."""
    return any(entry.name == layer and entry.mean_known == "unknown" for entry in record.layers)


@dataclass(frozen=True, kw_only=True)
class References:
    """References below `folder`, one file for each plan and whatever turns it into pixels."""

    folder: Path
    made_by: dict[str, str]

    def get(self, plan: ExamplePlan, mesh_root: Path) -> dict[str, np.ndarray]:
        """The layers of `plan`, from the cache or rendered now: name -> (H, W, C) float32, with the standard error of
        each that has noise as `<name>_se`. Raises OutputError where the disk refuses."""
        path = self.path(plan)
        if (found := _cached(path)) is not None:
            return found
        layers = render(plan, mesh_root).layers
        stream = BytesIO()
        np.savez(stream, allow_pickle=False, **layers)
        write_atomic(path, stream.getvalue())
        return layers

    def path(self, plan: ExamplePlan) -> Path:
        """Where the reference of a plan lies."""
        key = digest({"plan": plan.model_dump(mode="json"), "versions": self.made_by})
        return self.folder / f"{plan.key}-{key[:32]}.npz"


def pixel_versions(backend: str) -> dict[str, str]:
    """Versions of whatever turns a plan into pixels."""
    names = ("mapbox_earcut", "numpy", "open3d", "pillow", "scipy")
    libraries = {name: importlib.metadata.version(name) for name in names}
    return {**renderer_versions(backend), **libraries, "source": source_digest(*PIXELS)}


def _cached(path: Path) -> dict[str, np.ndarray] | None:
    """The layers of a file of the cache; None where there is none, or one that is damaged."""
    try:
        # NumPy leaves a damaged file open
        with np.load(BytesIO(path.read_bytes())) as file:
            return {name: file[name] for name in file.files}
    except (FileNotFoundError, BadZipFile, ValueError, EOFError):
        return None
