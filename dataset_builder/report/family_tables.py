"""The embedded furniture, as tables of parameters and materials."""

from rich.table import Table

from dataset_builder.assets.procedural.furniture import FINISHES, make_furniture
from dataset_builder.errors import UserError
from dataset_builder.planning.scene.assets_of_plan import ROLE
from dataset_builder.seeding import rng
from dataset_builder.spec.families import FAMILIES, Family
from dataset_builder.spec.model import Model
from dataset_builder.spec.numbers import draw

DRAWS, SHOWN = 24, 6
"""Pieces that are drawn to list possible materials, and the number of materials listed."""


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
