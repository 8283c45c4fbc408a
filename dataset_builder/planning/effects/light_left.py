"""How much of the light in a picture longer paths would bring: estimated from paths that planning traces, with a bound.

The share of a picture's light that paths of more than n edges bring is a ratio of two means over N independent paths.
Its upper bound adds to it, at a confidence of 99.9%, `SIGMAS` of its standard errors (Cochran, "Sampling techniques",
1977, section 2.11), and what no path met: an event that N paths miss has a probability of at most ln(1000) / N, and is
taken to bring as much as those that they met, less what further scattering takes.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil, log
from pathlib import Path

import numpy as np

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.example_plan import RenderPlan
from dataset_builder.label.scene_plan import CameraPlan, FogPlan, IlluminationPlan, LightPlan, PlacedObject, RoomPlan
from dataset_builder.layers import LAYERS
from dataset_builder.planning.effects.light_walk import (
    Walkers,
    WalkScene,
    arrivals,
    from_camera,
    from_white,
    joined,
)
from dataset_builder.planning.effects.walk_lamps import WalkLamps
from dataset_builder.planning.effects.walk_surfaces import WalkPart, WalkSurfaces
from dataset_builder.planning.scene.assets_of_plan import asset_of, world_from_object
from dataset_builder.planning.scene.box_shell import BoxShell
from dataset_builder.planning.scene.recent import Recent
from dataset_builder.planning.scene.room_parts import room_parts
from dataset_builder.seeding import rng

MAX_DEPTH = 512
"""Edges of the longest paths that are planned."""
SIGMAS, DOUBT = 3.09, 1e-3
"""Standard errors that a normal number exceeds with this probability."""
PATHS, GLASS_PATHS, FOG_PATHS, MOST_PATHS = 5.0, 10.0, 40.0, 8192
"""Paths of each kind per 1 / bias; with solid glass and in thick fog, where a few carry much; at most."""
THICK = 0.5
"""Times per metre that fog scatters light from which on it is thick: long paths bring most where they pass a lamp."""
RAW = ("s", "s_prime")
"""Layers of raw lighting."""
LONG, WORTH, MORE = 24, 1.5, 4
"""Edges, and times those expected, beyond which it is worth while to trace so many times the paths."""
WIDTHS = (128, 256)
"""Edges, counted from 0, up to which the light of short paths is looked through."""
MET = 10
"""Paths that show what an event brings."""
LOOKS = 8
"""Rays of the frame per path, among which those to the target are found."""
SURFACES = Recent[WalkSurfaces](4, 1 << 29, lambda found: found.bytes)
LEFT = Recent["LightLeft"](32)


@dataclass(frozen=True, kw_only=True, eq=False)
class LightLeft:
    """What longer paths bring to the pictures of a pass; the worst of these, which may differ from depth to depth."""

    paths: int
    """Traced, 0 where no light was found."""
    share: np.ndarray
    """(MAX_DEPTH + 1,) estimated share of the light that paths of more than n edges bring."""
    bound: np.ndarray
    """(MAX_DEPTH + 1,) its upper bound, falling with n."""

    @staticmethod
    def of(groups: Sequence[np.ndarray], share: float) -> "LightLeft":
        """From light that paths of each picture brought, (N, MAX_DEPTH + 1) by edges. share: most that an event leaves.
        """
        found = [_one(group, share) for group in groups if group[:, 2:].any()]
        if not found:
            return LightLeft(paths=0, share=np.ones(MAX_DEPTH + 1), bound=np.ones(MAX_DEPTH + 1))
        estimate, bound = (np.max([one[k] for one in found], axis=0) for k in (0, 1))
        return LightLeft(paths=sum(map(len, groups)), share=estimate, bound=bound)

    def least(self, bias: float) -> int:
        """Least number of edges whose bound is at most `bias`; MAX_DEPTH + 1 where none is."""
        kept = np.flatnonzero(self.bound <= bias)
        return max(int(kept[0]), 2) if len(kept) else MAX_DEPTH + 1


def _one(light: np.ndarray, most: float) -> tuple[np.ndarray, np.ndarray]:
    """Share and bound of one picture. Light that surfaces or lamps send to the camera directly does not count."""
    count, longest, columns = len(light), int(np.flatnonzero(light.any(axis=0))[-1]), light.shape[1]
    # Few paths are long. NumPy adds up rows in runs of 128, so that the sums are those of whole rows to the last bit
    width = next((cut for cut in WIDTHS if longest < cut < columns), columns)
    traced = np.where(np.arange(width) < 2, 0, light[:, :width])
    beyond = _beyond(traced) if width == columns else np.zeros(count)
    # Column n: what has gone more than n edges
    later = beyond[:, None] + np.cumsum(traced[:, ::-1], axis=1)[:, ::-1] - traced
    total = traced.sum(axis=1) + beyond
    mean = total.mean()
    if not np.isfinite(mean):
        return np.ones(columns), np.ones(columns)
    share = later.mean(axis=0) / mean
    error = np.sqrt(np.mean((later - share * total[:, None]) ** 2, axis=0) / count) / mean
    carrying = (later > 0).sum(axis=0)
    brings = later.sum(axis=0) / np.maximum(carrying, 1) / mean
    share, error, carrying, brings = (np.pad(each, (0, columns - width)) for each in (share, error, carrying, brings))
    last = int(np.flatnonzero(carrying >= min(MET, carrying[0]))[-1])
    further = np.maximum(np.arange(len(brings)) - last, 0)
    brings = np.where(further > 0, brings[last] * most**further, brings)
    bound = share + SIGMAS * error - log(DOUBT) / count * brings
    return share, np.minimum(np.minimum.accumulate(bound), 1)


def _beyond(light: np.ndarray) -> np.ndarray:
    """(N,) what paths will bring after the last edge that they were followed to: as their second half brought it, each
    further half the same share of the one before; infinite where that is no less."""
    half = light.shape[1] // 2
    before, last = light[:, :half].sum(), light[:, half:].sum(axis=1)
    share = last.sum() / before if before else 1.0
    return last * share / (1 - share) if share < 1 else np.where(last.any(), np.inf, last)


def light_left(*, room: RoomPlan, target: PlacedObject, furniture: Sequence[PlacedObject], light: IlluminationPlan,
               kept: Sequence[LightPlan], fog: FogPlan, camera: CameraPlan, render: RenderPlan, passes: Sequence[str],
               bias: float, share: float, glass: bool, mesh_root: Path) -> LightLeft:
    """Of the pictures that `passes`, which share a light, make of a view. kept: lights that are simulated. share: most
    of the light that one event leaves. glass: whether some of it is, so that few paths may carry much. The same
    arguments give the same answer.

    Raises UserError and PlanError as `room_parts` and `asset_of` do.
    """
    kinds = tuple(dict.fromkeys(_pictures(render, passes)))
    where = (room, target, tuple(furniture), light.open, mesh_root)
    thick = fog.extinction * fog.albedo >= THICK
    paths = min(ceil((FOG_PATHS if thick else GLASS_PATHS if glass else PATHS) / bias), MOST_PATHS)
    key = (where, tuple(kept), fog, camera, render.width, render.height, render.seed, kinds, paths, share, bias)

    def trace(paths: int) -> LightLeft:
        surfaces = SURFACES.get(where, lambda: WalkSurfaces([*_around(room, light.open, mesh_root),
                                                             *_standing(target, furniture, mesh_root)]))
        air = (np.array(BoxShell(room).extent) if room.kind == "procedural" else
               np.sort([surfaces.extent[0], surfaces.extent[1], camera.position], axis=0)[[0, 2]])
        scene = WalkScene(surfaces=surfaces, lamps=WalkLamps(kept), fog=fog, air=air)
        draws = rng(int(render.seed), "light left", paths, *light.open)
        groups = _groups(scene, Pinhole.of(camera, render.width, render.height), kinds, paths, draws)
        return LightLeft.of(groups, share)

    def find() -> LightLeft:
        found = trace(paths)
        expected = int(np.argmax(found.share <= bias)) if found.share[-1] <= bias else MAX_DEPTH
        more = found.least(bias) > max(LONG, WORTH * expected) and paths < MOST_PATHS
        return trace(min(MORE * paths, MOST_PATHS)) if more else found

    return LEFT.get(key, find)


def _pictures(render: RenderPlan, passes: Sequence[str]) -> Iterable[tuple[bool, bool]]:
    """Pairs of whether a picture shows raw lighting, and whether it shows the target alone."""
    for name, extent in render.layers:
        layer = LAYERS[name]
        if layer.radiometric and not name.endswith("_se") and layer.render_pass in passes:
            white = name in RAW
            yield white, True
            if extent == "frame":
                yield white, False


def _groups(scene: WalkScene, camera: Pinhole, kinds: Sequence[tuple[bool, bool]], paths: int,
            draws: np.random.Generator) -> list[np.ndarray]:
    places = draws.random((LOOKS * paths, 2)) * [camera.width, camera.height]
    ahead = camera.directions(places[:, 0], places[:, 1])
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    met = scene.surfaces.meet(np.tile(camera.position, (len(ahead), 1)), ahead)
    on_target = np.flatnonzero(met.there & met.target)
    chosen = {True: np.resize(on_target, min(paths, LOOKS * len(on_target))), False: np.arange(paths)}
    starts, normals = list[Walkers](), list[np.ndarray]()
    for white, alone in sorted(kinds):
        start = from_camera(camera.position, ahead[chosen[alone]])
        if white:
            start, normal = from_white(scene, start, draws)
            normals.append(normal)
        starts.append(start)
    if not starts:
        return []
    light = arrivals(scene, joined(starts), MAX_DEPTH, draws, np.concatenate(normals) if normals else None)
    return np.split(light, np.cumsum([len(start.number) for start in starts])[:-1])


def _around(room: RoomPlan, opened: Sequence[str], mesh_root: Path) -> list[WalkPart]:
    return [WalkPart(asset=part.asset, positions=part.positions, mirrored=bool(np.linalg.det(part.world[:3, :3]) < 0))
            for part in room_parts(room, mesh_root) if part.part not in opened]


def _standing(target: PlacedObject, furniture: Sequence[PlacedObject], mesh_root: Path) -> list[WalkPart]:
    parts = []
    for placed in (target, *furniture):
        asset, matrix = asset_of(placed.object, mesh_root), world_from_object(placed)
        parts.append(WalkPart(asset=asset, positions=asset.mesh.positions @ matrix[:3, :3].T + matrix[:3, 3],
                              target=placed is target))
    return parts
