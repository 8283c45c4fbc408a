"""Light from outside: a uniform sky or an image of one, a sun, and how much of them reaches the object."""

from collections.abc import Callable
from functools import lru_cache, partial
from math import pi
from pathlib import Path

import numpy as np

from dataset_builder.digest import sha256_file
from dataset_builder.errors import PlanError, Problem
from dataset_builder.label.scene_plan import LightPlan, Vector
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.cameras import towards, vector
from dataset_builder.planning.view.emission import sky_directions
from dataset_builder.planning.view.sun_window import faced, require_entry
from dataset_builder.planning.view.visibility import Sight
from dataset_builder.spec.light import SourceSpec, SunSpec, TargetSpec
from dataset_builder.spec.numbers import draw
from dataset_builder.spread import spaced

Stream = Callable[..., np.random.Generator]
"""Makes the generator of a path below the view's."""
SKY_POINTS, SKY_RAYS = 24, 24
LIFT = 1e-3
"""Metres above a surface that shadow rays start."""
ORIGIN: Vector = (0.0, 0.0, 0.0)
MIN_WEIGHT = 0.02
"""Of what a light outside would send unhindered: it keeps this share of light samples even where none was seen to get
in, since planning looks from few points."""


def dome(radiance: float, *, image: str = "", image_sha256: str = "", turn: float = 0.0) -> LightPlan:
    """A uniform grey dome, or an image of the sky around, brought to mean 1, times `radiance`."""
    return LightPlan(kind="dome", position=ORIGIN, direction=ORIGIN, size=0.0, cutoff=0.0, radiance=(radiance,) * 3,
                     temperature=0.0, weight=pi * radiance, image=image, image_sha256=image_sha256, turn=turn)


def sun(spec: SunSpec, stream: Stream, key: str, arrangement: Arrangement | None) -> LightPlan:
    """A sun, drawn; its irradiance may be 0. Raises PlanError where it is aimed at an opening that it cannot shine
    through, or that no arrangement is there to have."""
    irradiance = draw(spec.irradiance, stream("irradiance"))
    azimuth, elevation = draw(spec.azimuth, stream("azimuth")), draw(spec.elevation, stream("elevation"))
    if spec.through and irradiance:
        if arrangement is None:
            raise PlanError([Problem(where="", path=f"{key}.sun.through", rule="expected no such key where the object "
                                     "is seen through a field, whose light knows no room", hint="leave it out")])
        azimuth += faced(arrangement, spec.through, key)
        require_entry(arrangement, spec.through, azimuth, elevation, key)
    upward = towards(azimuth, elevation)
    return LightPlan(kind="sun", position=ORIGIN, direction=vector(-upward), size=0.0, cutoff=0.0,
                     radiance=(irradiance,) * 3, temperature=0.0, weight=irradiance)


def outside(spec: SourceSpec | TargetSpec, stream: Stream, root: Path, key: str,
            arrangement: Arrangement | None = None) -> list[LightPlan]:
    """What shines from outside: dome and sun, drawn, those that are not 0. root: folder of the dataset file; key: the
    part of the spec; arrangement: what has the windows. Raises PlanError where the image of the sky cannot be read, or
    a sun cannot shine through the window that it is aimed at."""
    lights = list[LightPlan]()
    if (value := draw(spec.dome, stream("dome"))) > 0:
        shown = image_of(root, spec.environment, f"{key}.environment") if spec.environment else {}
        lights.append(dome(value, turn=draw(spec.turn, stream("turn")) if shown else 0.0, **shown))
    if spec.sun is not None and any((found := sun(spec.sun, partial(stream, "sun"), key, arrangement)).radiance):
        lights.append(found)
    return lights


def image_of(root: Path, name: str, key: str) -> dict[str, str]:
    """Fields of a light that shows the image `name`, a path relative to `root`.

    Raises PlanError where there is no file that can be read; what is in it is looked at when it is rendered.
    """
    path = root / name
    try:
        found = path.stat()
        return {"image": name, "image_sha256": _digest(path, found.st_mtime_ns, found.st_size)}
    except OSError as error:
        raise PlanError([Problem(where=str(path), path=key, rule=f"expected an image, got: {error.strerror}",
                                 hint="paths are relative to the dataset file")]) from error


@lru_cache(maxsize=256)
def _digest(path: Path, modified: int, size: int) -> str:
    """Of a file as it was when it had this time and size: every light of a dataset asks for it."""
    return sha256_file(path)


def sky_share(arrangement: Arrangement, sight: Sight) -> float:
    """Share of a dome's irradiance that gets through windows or an open ceiling to the visible points, on average."""
    pick = spaced(len(sight.points), SKY_POINTS)
    normals = sight.normals[pick]
    aside = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    tangent = np.cross(aside, normals)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    basis = np.stack([tangent, np.cross(normals, tangent), normals], axis=1)
    directions = (sky_directions(SKY_RAYS)[None] @ basis).reshape(-1, 3)
    origins = np.repeat(sight.points[pick] + LIFT * normals, SKY_RAYS, axis=0)
    _, distance = arrangement.everything.first_hit(origins, directions)
    return float(np.isinf(distance).mean())


def sunlit(arrangement: Arrangement, light: LightPlan, points: np.ndarray) -> np.ndarray:
    """(N,) bool: whether nothing stands between points (N, 3) and the sun; panes do not count."""
    upward = np.broadcast_to(-np.asarray(light.direction), points.shape)
    return np.isinf(arrangement.everything.first_hit(points, upward)[1])


def weighed(light: LightPlan, share: float) -> LightPlan:
    """A light outside, weighed by the share of its irradiance that gets in: light samples follow what they find."""
    return light.model_copy(update={"weight": light.weight * max(share, MIN_WEIGHT)})
