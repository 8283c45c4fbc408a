"""JSON Schemas of spec files, for editors that complete and underline YAML."""

import json
from pathlib import Path
from typing import Any

from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.model import Model
from dataset_builder.spec.scene import ObjectSpec, RoomSpec, SceneSpec

KINDS: dict[str, type[Model]] = {"dataset": DatasetSpec, "object": ObjectSpec, "room": RoomSpec, "scene": SceneSpec,
                                 "training": TrainingSpec}
"""The kinds of file under `scene_specs/`, by the name of their schema."""

DRAFT = "https://json-schema.org/draft/2020-12/schema"


def export_schema() -> dict[str, dict[str, Any]]:
    """JSON Schema of each kind of file, by kind. Rules between keys and files are left to the loader."""
    return {kind: {"$schema": DRAFT, **model.model_json_schema(mode="validation")} for kind, model in KINDS.items()}


def schema_files() -> dict[str, str]:
    """Text of each schema file, by file name."""
    return {f"{kind}.schema.json": json.dumps(schema, indent=2, sort_keys=True) + "\n"
            for kind, schema in export_schema().items()}


def write_schema(folder: Path) -> None:
    """Write every schema file into `folder`, which is made where it is missing."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in schema_files().items():
        (folder / name).write_text(text, encoding="utf-8")
