"""Converged references, rendered once and kept beside the study's results."""

import importlib.metadata
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from dataset_builder.digest import digest
from dataset_builder.engine.source import source_digest
from dataset_builder.files import write_atomic
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.rendering.backend import renderer_versions
from dataset_builder.studies.timing import render

PIXELS = ("rendering.examples", "rendering.backend")
"""What turns a plan into pixels: reports may change without a reference being lost."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """A rendered reference."""

    layers: dict[str, np.ndarray]
    """Name -> (H, W, C) float32, with the standard error of each that has noise as `<name>_se`."""
    cached: bool
    """It was there already."""


@dataclass(frozen=True, kw_only=True)
class References:
    """References below `folder`, one file for each plan and whatever turns it into pixels."""

    folder: Path
    made_by: dict[str, str]

    def get(self, plan: ExamplePlan, mesh_root: Path) -> Reference:
        """The layers of `plan`, from the cache or rendered now. Raises OutputError where the disk refuses."""
        path = self.path(plan)
        if (found := _read(path)) is not None:
            return Reference(layers=found, cached=True)
        layers = render(plan, mesh_root).layers
        stream = BytesIO()
        np.savez(stream, allow_pickle=False, **layers)
        write_atomic(path, stream.getvalue())
        return Reference(layers=layers, cached=False)

    def path(self, plan: ExamplePlan) -> Path:
        """Where the reference of a plan lies."""
        key = digest({"plan": plan.model_dump(mode="json"), "versions": self.made_by})
        return self.folder / f"{plan.key}-{key[:32]}.npz"


def pixel_versions(backend: str) -> dict[str, str]:
    """Versions of whatever turns a plan into pixels."""
    libraries = {name: importlib.metadata.version(name) for name in ("numpy", "open3d", "scipy", "trimesh")}
    return {**renderer_versions(backend), **libraries, "source": source_digest(*PIXELS)}


def _read(path: Path) -> dict[str, np.ndarray] | None:
    """The layers of a file of the cache; None where there is none, or one that is damaged."""
    try:
        # NumPy leaves a damaged file open
        with np.load(BytesIO(path.read_bytes())) as file:
            return {name: file[name] for name in file.files}
    except (FileNotFoundError, BadZipFile, ValueError, EOFError):
        return None
