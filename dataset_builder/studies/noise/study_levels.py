"""The levels of the study: vertex noise by deviation or by name, and meshes reconstructed from images beside it."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any, Literal, get_args

from dataset_builder.errors import Problem, UserError
from dataset_builder.spec.load import read_text
from dataset_builder.spec.rough_levels import NAMED, sigma_of

Kind = Literal["noise", "density", "sdf"]
FIELDS: tuple[Kind, ...] = get_args(Kind)[1:]


@dataclass(frozen=True, kw_only=True)
class StudyLevel:
    """One way that rough meshes are made."""

    title: str
    """For people: `sigma 0.004`, or `density, views 20`."""
    kind: Kind = "noise"
    """noise: of vertices; else the field that the mesh is taken from."""
    sigma: float = 0.0
    """Standard deviation of noise in bounding radii; 0 of a mesh from a field."""
    written: str
    """What stands in a spec: a number, a name, or a mapping as JSON."""

    @property
    def noise(self) -> bool:
        """Whether it is noise on the clean mesh."""
        return self.kind == "noise"


def parse_levels(text: str, shared: Sequence[str] = ()) -> tuple[StudyLevel, ...]:
    """Levels as the command line gives them, noise before fields. shared: `KEY=VALUE` of every field.

    Noise is a number or a name; a field is its kind and, after colons, keys of `rough.fields` that are its own. Raises
    UserError where a level is none of these.

    >>> [level.title for level in parse_levels("0,4e-3,density,sdf:views=20:resolution=64")]
    ['sigma 0', 'sigma 0.004', 'density', 'sdf, views 20, resolution 64']
    >>> [level.sigma for level in parse_levels("smooth, heavy")]
    [0.0, 0.012]
    """
    found = [_level(part.strip(), shared) for part in text.split(",")]
    return tuple(sorted(found, key=lambda level: not level.noise))


def problems_of(levels: Sequence[StudyLevel]) -> list[Problem]:
    """What is wrong with levels together."""
    noise = [level for level in levels if level.noise]
    fields = [level.written for level in levels if not level.noise]
    sigmas, rules = [level.sigma for level in noise], []
    if sigmas != sorted(set(sigmas)) or len(noise) < 2 or sigmas[0] < 0:
        rules.append("expected at least two numbers >= 0, each larger than the one before, got "
                     f"{', '.join(f'{sigma:g}' for sigma in sigmas) or 'none'}")
    if len({_named(level) for level in noise}) > 1:
        rules.append(f"expected numbers or names, not both, got {', '.join(level.title for level in noise)}")
    if len(set(fields)) < len(fields):
        rules.append("expected each field once, got one twice")
    return [Problem(where="", path="--levels", rule=rule) for rule in rules]


def overrides_of(levels: Sequence[StudyLevel]) -> tuple[str, ...]:
    """What they change in a dataset's spec."""
    noise = [level for level in levels if level.noise]
    written = f"[{', '.join(level.written for level in noise)}]"
    sigma, name = ("null", written) if any(map(_named, noise)) else (written, "null")
    fields = ", ".join(level.written for level in levels if not level.noise)
    return ("rough.steps=null", f"rough.sigma={sigma}", f"rough.level={name}", f"rough.fields=[{fields}]")


def _named(level: StudyLevel) -> bool:
    return level.written in NAMED


def _level(part: str, shared: Sequence[str]) -> StudyLevel:
    if part in NAMED:
        return StudyLevel(title=f"{part} (sigma {sigma_of(part):g})", sigma=sigma_of(part), written=part)
    kind, *own = part.split(":")
    if kind in FIELDS:
        keys = dict(_key(text) for text in (*shared, *own))
        title = ", ".join([kind, *(" ".join(text.split("=", 1)) for text in own)])
        return StudyLevel(title=title, kind=kind, written=json.dumps(_nested(kind, keys)))  # type: ignore[arg-type]
    try:
        sigma = float(part)
    except ValueError:
        sigma = float("nan")
    if not isfinite(sigma):
        raise UserError(f"--levels: expected numbers, or names ({', '.join(NAMED)}), or fields ({', '.join(FIELDS)}, "
                        f"as in sdf:views=20), with commas between them, got {part or 'nothing'}")
    return StudyLevel(title=f"sigma {sigma:g}", sigma=sigma, written=repr(sigma))


def _key(text: str) -> tuple[str, Any]:
    key, equals, value = text.partition("=")
    if not equals or not key.strip() or not value.strip():
        raise UserError(f"--levels: expected KEY=VALUE of a field, such as views=20, got {text or 'nothing'}")
    return key.strip(), read_text(value, "--levels").data


def _nested(kind: str, keys: dict[str, Any]) -> dict[str, Any]:
    """Dotted keys as mappings in mappings."""
    found: dict[str, Any] = {"field": kind}
    for key, value in keys.items():
        *outer, last = key.split(".")
        place = found
        for name in outer:
            place = place.setdefault(name, {})
        place[last] = value
    return found
