"""Every family by name, and the function that makes furniture."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dataset_builder.assets.asset import Asset
from dataset_builder.assets.procedural import beds, case_goods, decor, seating, tables, upholstery
from dataset_builder.assets.procedural.parts import Made, assemble
from dataset_builder.errors import Problem, UserError
from dataset_builder.seeding import rng
from dataset_builder.spec.families import FAMILIES, Family

Maker = Callable[[dict[str, float], np.random.Generator, np.random.Generator], Made]
"""Of parameters and two generators: of the finishes, and of details such as books and folds."""

MAKERS: dict[str, Maker] = {
    "chair": seating.chair, "armchair": upholstery.armchair, "sofa": upholstery.sofa, "stool": seating.stool,
    "bench": seating.bench, "ottoman": upholstery.ottoman, "dining_table": tables.dining_table,
    "coffee_table": tables.coffee_table, "desk": tables.desk, "cabinet": case_goods.cabinet,
    "bookshelf": case_goods.bookshelf, "wardrobe": case_goods.wardrobe, "nightstand": case_goods.nightstand,
    "bed": beds.bed, "floor_lamp": decor.floor_lamp, "vase": decor.vase, "plant": decor.plant,
}
"""The function that makes each family of `spec.families.FAMILIES`."""

FINISHES: dict[str, tuple[str, ...]] = {
    "chair": ("frame", "cover"), "armchair": ("cover", "legs"), "sofa": ("cover", "legs", "pillow"),
    "stool": ("frame", "cover", "metal"), "bench": ("frame", "cover"), "ottoman": ("cover", "legs"),
    "dining_table": ("frame", "top"), "coffee_table": ("frame", "top", "books"), "desk": ("frame", "front", "metal"),
    "cabinet": ("frame", "metal", "front"), "bookshelf": ("frame", "books"), "wardrobe": ("frame", "metal"),
    "nightstand": ("frame", "metal", "books"), "bed": ("frame", "sheet", "blanket", "cover"),
    "floor_lamp": ("stand", "shade", "bulb"), "vase": ("glaze",), "plant": ("pot", "soil", "leaf"),
}
"""What the materials of each family are there for; a draw may go without some. Their names begin with it."""


def make_furniture(*, family: str, params: dict[str, float], seed: int, name: str) -> Asset:
    """Piece of furniture of `family` with all its `params` given; materials and details follow from `seed`.

    The asset's mesh is closed, outward, on the floor and centred; the same arguments give the same arrays.
    Raises UserError for an unknown family, and for missing, unknown or out-of-range parameters, all at once.
    """
    if family not in FAMILIES:
        raise UserError([Problem(where=name, path="family",
                                 rule=f"expected one of {', '.join(FAMILIES)}, got {family}")])
    values = _checked(FAMILIES[family], params, name)
    finish_rng, part_rng, detail_rng = rng(seed, "furniture", family).spawn(3)
    parts, finishes = MAKERS[family](values, finish_rng, detail_rng)
    asset = assemble(parts, finishes, name=name, category=FAMILIES[family].category, rng=part_rng)
    return replace(asset, meta=asset.meta | {"family": family})


def _checked(family: Family, params: dict[str, float], name: str) -> dict[str, float]:
    """The parameters in table order, whole where they count or name a style."""
    known = [param.name for param in family.params]
    problems = [Problem(where=name, path=f"params.{key}", rule=f"unknown; {family.name} has {', '.join(known)}")
                for key in params if key not in known]
    for param in family.params:
        if param.name not in params:
            problems.append(Problem(where=name, path=f"params.{param.name}",
                                    rule=f"missing; {family.name} needs {', '.join(known)}"))
        elif not param.low <= params[param.name] <= param.high:
            problems.append(Problem(where=name, path=f"params.{param.name}",
                                    rule=f"expected in [{param.low:g}, {param.high:g}], got {params[param.name]:g}"))
    if problems:
        raise UserError(problems)
    return {param.name: float(round(params[param.name])) if param.integer else float(params[param.name])
            for param in family.params}
