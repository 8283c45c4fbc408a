"""What examples and results of passes are known by: plans, and the versions of whatever makes them."""

import importlib.metadata
from collections.abc import Sequence

from dataset_builder.digest import digest
from dataset_builder.engine import source
from dataset_builder.label.example_label import Denoised
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.rendering import oidn
from dataset_builder.rendering.backend import renderer_versions
from dataset_builder.shards.writer import writer_versions
from dataset_builder.spec.dataset import DatasetSpec

FIELD_LIBRARY = "scikit-image"
"""What fields need besides the renderer."""


def versions(backend: str, spec: DatasetSpec) -> dict[str, str]:
    """Versions of whatever turns a plan of a dataset into bytes: a change of any makes an example another one. The
    denoiser must be installed where layers are denoised."""
    denoise = bool(spec.render.denoise.layers)
    names = ("mapbox_earcut", "open3d", "pillow", "scipy", *((oidn.PACKAGE,) if denoise else ()),
             *((FIELD_LIBRARY,) if spec.fields else ()))
    libraries = {name: importlib.metadata.version(name) for name in names}
    return {**renderer_versions(backend), **libraries, **own_versions(spec)}


def own_versions(spec: DatasetSpec) -> dict[str, str]:
    """Those of `versions` that say who writes a dataset, whatever renders it: this package's code among them."""
    code = source.source_digest(source.UNIT, *((source.CALIBRATION,) if spec.render.denoise.layers else ()),
                                *((source.FIELDS,) if spec.fields else ()))
    return {**writer_versions(), "source": code}


def field_versions(backend: str) -> dict[str, str]:
    """Versions of whatever makes fields."""
    names = ("mapbox_earcut", "numpy", "open3d", "pillow", "scipy", FIELD_LIBRARY)
    libraries = {name: importlib.metadata.version(name) for name in names}
    return {**renderer_versions(backend), **libraries, "source": source.source_digest(source.FIELDS)}


def pass_versions(backend: str) -> dict[str, str]:
    """Versions of whatever turns a plan into the results of its passes."""
    names = ("mapbox_earcut", "numpy", "open3d", "pillow", "scipy")
    libraries = {name: importlib.metadata.version(name) for name in names}
    return {**renderer_versions(backend), **libraries, "source": source.source_digest(source.PASSES)}


def plan_digest(plan: ExamplePlan, spec: DatasetSpec, made_by: dict[str, str],
                denoised: Sequence[Denoised] = ()) -> str:
    """Key of a finished example: its plan, how it is stored and gated, what made it, and the figures it carries."""
    stored = {"dtype": spec.storage.dtype, "gates": spec.gates.model_dump(mode="json")}
    return digest({"plan": plan.model_dump(mode="json"), "storage": stored, "versions": made_by,
                   "denoised": [figures.model_dump(mode="json") for figures in denoised]})
