"""Changes of materials: drawn from a spec, matched by name, and made."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields as fields_of
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any

from dataset_builder.assets.asset import Material, reflectance_at
from dataset_builder.errors import PlanError, Problem
from dataset_builder.label.scene_plan import MaterialChange, Param
from dataset_builder.seeding import rng
from dataset_builder.spec.numbers import draw
from dataset_builder.spec.problems import nearest, shown
from dataset_builder.spec.scene import MAX_SPECULAR, MaterialSpec, SurfaceSpec

ROLE = ": "
"""Between what a material of embedded furniture is there for and what it happens to be: `top: oak`."""
TRUTHS, WHOLE = ("thin", "plain"), ("priority",)
FIELDS = (*(field.name for field in fields_of(Material) if field.name in MaterialSpec.model_fields), "plain")
"""What a change may change, in the order that labels have it."""


def drawn_changes(spec: Mapping[str, MaterialSpec], seed: int, path: tuple[str | int, ...]) \
        -> tuple[MaterialChange, ...]:
    """Draw the changes to an object's materials, each number from a path of its own below `path`.

    An index of refraction without `specular` brings the reflectance that belongs to it, ((n - 1) / (n + 1))^2.
    """
    return tuple(MaterialChange(name=name, values=drawn_values(change, seed, (*path, name)))
                 for name, change in spec.items())


def drawn_values(change: SurfaceSpec, seed: int, path: tuple[str | int, ...]) -> tuple[Param, ...]:
    """Draw the fields that a change has, each number from a path of its own below `path`."""
    values: dict[str, float] = {}
    for field in FIELDS:
        value = getattr(change, field, None)
        if isinstance(value, tuple):
            values |= {f"{field}.{k}": draw(each, rng(seed, *path, field, k)) for k, each in enumerate(value)}
        elif isinstance(value, bool):
            values |= {field: float(value)} if value or field != "plain" else {}
        elif value is not None:
            values[field] = draw(value, rng(seed, *path, field))
    if "ior" in values and "specular" not in values:
        values["specular"] = min(reflectance_at(values["ior"]), MAX_SPECULAR)
    return tuple(Param(name=name, value=value) for name, value in values.items())


def matches(name: str, material: str) -> bool:
    """Whether a change called `name` means a material: by its name, by its role, or as a pattern with * and ?."""
    return name in (material, material.partition(ROLE)[0]) or fnmatchcase(material, name)


def changed(materials: Sequence[Material], changes: Sequence[MaterialChange], where: str,
            roles: Sequence[str] = ()) -> tuple[Material, ...]:
    """The materials with all changes that mean them, in order.

    roles: what the asset's family may have besides, so that a change of it is no mistake where a draw goes without.
    Raises PlanError for changes that mean no material, with the names that there are.
    """
    known = [material.name for material in materials]
    lost = [change.name for change in changes if not any(matches(change.name, name) for name in known)
            and not (roles and _may_mean(change.name, roles))]
    _refuse(lost, [*roles, *known], where)
    return tuple(applied(material, [change for change in changes if matches(change.name, material.name)])
                 for material in materials)


def require_roles(names: Iterable[str], roles: Sequence[str], where: str) -> None:
    """Raise PlanError for changes that no draw of a family with the materials `roles` could mean."""
    _refuse([name for name in names if not _may_mean(name, roles)], roles, where)


def _refuse(lost: Sequence[str], known: Sequence[str], where: str) -> None:
    if lost:
        raise PlanError(Problem(where=where, path=f"materials.{name}", hint=nearest(name, list(dict.fromkeys(known))),
                                rule=f"expected the name of one of the object's materials, got {shown(name)}")
                        for name in lost)


def _may_mean(name: str, roles: Sequence[str]) -> bool:
    """Whether another draw of a family may have what a change means; what a finish is drawn as varies."""
    return name.partition(ROLE)[0] in roles or any(character in name for character in "*?[")


def applied(material: Material, changes: Sequence[MaterialChange]) -> Material:
    """The material with all changes, in order."""
    for change in changes:
        values = {param.name: param.value for param in change.values}
        fields: dict[str, Any] = {name: value for name, value in values.items() if "." not in name and name != "plain"}
        fields |= {name: bool(fields[name]) for name in TRUTHS if name in fields}
        fields |= {name: int(fields[name]) for name in WHOLE if name in fields}
        for name in {key.partition(".")[0] for key in values if "." in key}:
            fields[name] = tuple(values[f"{name}.{k}"] for k in range(3))
        if values.get("plain"):
            fields["texture"] = None
        material = replace(material, **fields)
    return material
