"""What specs may contain: the embedded furniture as tables, and JSON Schemas for editors that complete YAML."""

import json
from pathlib import Path
from typing import Any

from rich.table import Table

from dataset_builder.assets.procedural.furniture import FINISHES, make_furniture
from dataset_builder.errors import UserError
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.planning.scene.material_changes import ROLE
from dataset_builder.seeding import rng
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.families import FAMILIES, Family
from dataset_builder.spec.model import Model
from dataset_builder.spec.numbers import draw
from dataset_builder.spec.scene import ObjectSpec, RoomSpec, SceneSpec

DRAWS, SHOWN = 24, 6
"""Pieces that are drawn to list possible materials, and the number of materials listed."""

KINDS: dict[str, type[Model]] = {"dataset": DatasetSpec, "object": ObjectSpec, "room": RoomSpec, "scene": SceneSpec,
                                 "training": TrainingSpec}
"""The kinds of file under `scene_specs/`, by the name of their schema."""

DRAFT = "https://json-schema.org/draft/2020-12/schema"


def family_tables(name: str | None) -> list[Table]:
    """One overview, or the parameters and materials of one family. Raises UserError for a family that is not there."""
    if name is None:
        table = Table("family", "what", "parameters")
        for family in FAMILIES.values():
            table.add_row(family.name, family.summary, ", ".join(param.name for param in family.params))
        return [table]
    if name not in FAMILIES:
        raise UserError(f"family: expected one of {', '.join(FAMILIES)}, got {name}")
    table = Table("parameter", "unit", "limits", "drawn from", "meaning", title=FAMILIES[name].summary)
    for param in FAMILIES[name].params:
        drawn = param.default.model_dump(mode="json") if isinstance(param.default, Model) else param.default
        table.add_row(param.name, param.unit, f"{param.low:g} to {param.high:g}", str(drawn), param.meaning)
    return [table, _materials(FAMILIES[name])]


def _materials(family: Family) -> Table:
    """What `materials` of an object file may name, and what draws make of it."""
    table = Table("material", "drawn as", title="names for `materials`; * is every one", title_justify="left")
    drawn: dict[str, list[str]] = {role: [] for role in FINISHES[family.name]}
    for seed in range(DRAWS):
        for role, _, finish in _drawn_names(family, seed):
            drawn[role].append(finish)
    for role, finishes in drawn.items():
        different = list(dict.fromkeys(finishes))
        table.add_row(role, ", ".join(different[:SHOWN]) + (", ..." if len(different) > SHOWN else ""))
    return table


def _drawn_names(family: Family, seed: int) -> list[tuple[str, str, str]]:
    params = {param.name: draw(param.default, rng(seed, family.name, param.name)) for param in family.params}
    asset = make_furniture(family=family.name, params=params, seed=seed, name=family.name)
    return [material.name.partition(ROLE) for material in asset.materials]


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
