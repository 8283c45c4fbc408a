"""3DF-Lighting builder: scene and object specs in, sharded EXR tuples for lighting transfer out.

`import dataset_builder as db` loads nothing else; a name is imported from its module at its first use.
"""

from typing import TYPE_CHECKING

__version__ = "0.1.0"

_HOMES = {
    "Dataset": "shards.reader", "ExampleLabel": "label.example_label", "ExamplePlan": "label.example_plan",
    "LightingDataset": "lightnet.data.lighting_dataset", "LoadedSpec": "spec.resolve", "Manifest": "shards.manifest",
    "Pinhole": "geometry.pinhole", "UserError": "errors",
    "build": "api", "irradiance": "geometry.harmonics", "load_spec": "api", "load_training": "lightnet.settings",
    "open_dataset": "shards.reader", "plan": "api", "render_example": "api", "tone_mapped": "api",
    "training_batches": "lightnet.data.loader", "verify": "api",
}
"""Module of each public name."""

__all__ = list(_HOMES)

if TYPE_CHECKING:
    from dataset_builder.api import build as build
    from dataset_builder.api import load_spec as load_spec
    from dataset_builder.api import plan as plan
    from dataset_builder.api import render_example as render_example
    from dataset_builder.api import tone_mapped as tone_mapped
    from dataset_builder.api import verify as verify
    from dataset_builder.errors import UserError as UserError
    from dataset_builder.geometry.harmonics import irradiance as irradiance
    from dataset_builder.geometry.pinhole import Pinhole as Pinhole
    from dataset_builder.label.example_label import ExampleLabel as ExampleLabel
    from dataset_builder.label.example_plan import ExamplePlan as ExamplePlan
    from dataset_builder.lightnet.data.lighting_dataset import LightingDataset as LightingDataset
    from dataset_builder.lightnet.data.loader import training_batches as training_batches
    from dataset_builder.lightnet.settings import load_training as load_training
    from dataset_builder.shards.manifest import Manifest as Manifest
    from dataset_builder.shards.reader import Dataset as Dataset
    from dataset_builder.shards.reader import open_dataset as open_dataset
    from dataset_builder.spec.resolve import LoadedSpec as LoadedSpec
else:
    def __getattr__(name: str) -> object:
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from importlib import import_module

        from dataset_builder.extras import missing_named

        with missing_named():
            value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        return [*__all__, "__version__"]
