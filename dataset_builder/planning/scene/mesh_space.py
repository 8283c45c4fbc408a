"""The space of a scene given as triangles, as rays find it: what cameras, lamps and light from outside meet."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from hashlib import sha256

import numpy as np

from dataset_builder.geometry.raycast import RayScene
from dataset_builder.planning.scene.free_floor import FreeFloor, bare_floor, furnished
from dataset_builder.planning.scene.shell import Geometry, box_of
from dataset_builder.planning.scene.storeys import MIN_FLOOR, Grid, areas_facing_up, corners_of, find_storeys

KEPT = 4
"""Scenes whose spaces are kept: they cost seconds."""
ABOUT = 0.2
"""Metres about the target's middle: a camera has a free line to one point of these at least, and a roof above half of
them is a roof above the target."""
AROUND = 10.0
"""Metres about a small scene without a building: lamps stand at distances that are usual in rooms."""
SAMPLES, FINER = 48, 2
"""Points of a way that are tried, and how often the last good step is tried again as finely."""
UP, DOWN = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True)
class Content:
    """Triangles, known by their digest."""

    digest: str
    building: tuple[Geometry, ...] = field(compare=False)
    """Floors, walls and ceilings."""
    contents: tuple[Geometry, ...] = field(compare=False)
    """All other things, without the target."""

    @classmethod
    def of(cls, building: Sequence[Geometry], contents: Sequence[Geometry]) -> "Content":
        """The triangles with a digest over both, in order."""
        total = sha256()
        for parts in (building, contents):
            for positions, faces, _ in parts:
                total.update(repr((positions.shape, faces.shape)).encode())
                total.update(np.ascontiguousarray(positions, np.float64).tobytes())
                total.update(np.ascontiguousarray(faces, np.int64).tobytes())
            total.update(b"|")
        return cls(total.hexdigest(), *(tuple(part for part in parts if len(part[1]))
                                        for parts in (building, contents)))


@lru_cache(maxsize=KEPT)
def _rays(content: Content) -> RayScene:
    return RayScene([*content.building, *content.contents])


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshSpace:
    """Answers from rays, cached by what the scene is made of."""

    content: Content
    """All but the target: what takes up place."""
    hiding: Content
    """What of it no light gets through: what hides what is behind it."""

    @cached_property
    def house(self) -> RayScene:
        """What is built; all there is where nothing says what that is."""
        return self._of(self.content)

    @cached_property
    def opaque_house(self) -> RayScene:
        """What is built and hides what is behind it."""
        return self._of(self.hiding)

    @cached_property
    def everything(self) -> RayScene:
        """All that hides what is behind it."""
        return _rays(self.hiding)

    def _of(self, content: Content) -> RayScene:
        return _rays(Content.of(content.building, ()) if self.content.building else content)

    @cached_property
    def extent(self) -> np.ndarray:
        """(2, 3) low and high corner of all there is; zeros where nothing is."""
        boxes = [box_of(part) for part in (*self.content.building, *self.content.contents)]
        low, high = zip(*boxes, strict=True) if boxes else ([np.zeros(3)], [np.zeros(3)])
        return np.stack([np.min(low, axis=0), np.max(high, axis=0)])

    @cached_property
    def _bounds(self) -> np.ndarray:
        """(2, 3) corners of what cameras and lamps stay in: the extent and its diagonal about it, or `AROUND`."""
        pad = max(float(np.linalg.norm(self.extent[1] - self.extent[0])), AROUND)
        return self.extent + np.array([[-pad], [pad]])

    @cached_property
    def _up(self) -> tuple[tuple[np.ndarray, np.ndarray], bool]:
        """Heights and areas of what may be floor, and whether that is everything, since nothing is known as built."""
        for either in (False, True):
            found = self._facing_up(self.content.building, either)
            if found[1].sum() >= MIN_FLOOR:
                return found, False
        return self._facing_up((*self.content.building, *self.content.contents), False), True

    @staticmethod
    def _facing_up(parts: Sequence[Geometry], either: bool) -> tuple[np.ndarray, np.ndarray]:
        found = [areas_facing_up(corners, either=either) for corners in corners_of(parts)]
        heights, areas = zip(*found, strict=True) if found else ((), ())
        return np.concatenate([np.zeros(0), *heights]), np.concatenate([np.zeros(0), *areas])

    @cached_property
    def ground(self) -> RayScene:
        """What floors are of."""
        return _rays(self.content) if self._up[1] else self.house

    @cached_property
    def floors(self) -> tuple[FreeFloor, ...]:
        """Storeys with what stands on them, lowest first."""
        if not self._up[0][1].sum() >= MIN_FLOOR:
            return ()
        contents = corners_of(self.content.contents)
        if contents and not self._up[1]:
            # Scenes that differ in what stands in them, as those of several targets do, share what is built
            built = space_of(*(Content.of(each.building, ()) for each in (self.content, self.hiding))).floors
            return tuple(furnished(floor, contents) for floor in built)
        grid = Grid.over(*self.extent)
        storeys = find_storeys(grid, self._up[0], self.ground, self.house, self._up[1])
        building = corners_of(self.content.building)
        return tuple(furnished(bare_floor(grid, storey, building), contents) for storey in storeys)

    def _finite(self, scene: RayScene, points: np.ndarray, direction: np.ndarray) -> np.ndarray:
        return np.isfinite(scene.first_hit(points, np.broadcast_to(direction, points.shape))[1])

    def roofed(self, centre: np.ndarray) -> bool:
        """Whether the target has a roof above it."""
        return bool(self._finite(self.opaque_house, _about(centre), UP).mean() >= 0.5)

    def inside(self, points: np.ndarray, margin: float, centre: np.ndarray) -> np.ndarray:
        """(N,) bool: whether a camera or a lamp may be at points (N, 3).

        It keeps `margin` metres from what is built and has a free line past that to the target's middle. Where the
        target has a roof above it, it has a floor below and a roof above; outdoors it is above ground, and not further
        from the scene than that is large.
        """
        good = ((points >= self._bounds[0]) & (points <= self._bounds[1])).all(axis=1)
        good &= self.house.distance(points) >= margin
        above, below = self._finite(self.opaque_house, points, UP), self._finite(self.ground, points, DOWN)
        outdoors = below | (~above & (points[:, 2] >= self.extent[0, 2]))
        good &= above & below if self.roofed(centre) else outdoors
        seen = np.zeros(len(points), bool)
        for aim in _about(centre):
            seen |= ~self.opaque_house.occluded(points, np.broadcast_to(aim, points.shape))
        return good & seen

    def depth(self, centre: np.ndarray, direction: np.ndarray, margin: float) -> float:
        """How far from the target's middle along a unit direction (3,) a point can be, at most, and still be `inside`;
        0 where none is."""
        wall = float(self.opaque_house.first_hit(centre[None], direction[None])[1][0])
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead = (np.where(direction > 0, *self._bounds[::-1]) - centre) / direction
        edges = np.where(direction == 0, np.inf, ahead)
        far, near = min(wall, max(float(edges.min()), 0.0)), 0.0
        for _ in range(1 + FINER):
            steps = np.linspace(near, far, SAMPLES + 1)[1:]
            good = np.flatnonzero(self.inside(centre + steps[:, None] * direction, margin, centre))
            if not len(good):
                return near
            near = float(steps[good[-1]])
            if good[-1] == SAMPLES - 1:
                return near
            far = float(steps[good[-1] + 1])
        return near


def _about(centre: np.ndarray) -> np.ndarray:
    """(5, 3) the target's middle, first, and points about it."""
    aside = np.array([[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    return np.asarray(centre + ABOUT * aside)


@lru_cache(maxsize=KEPT)
def space_of(content: Content, hiding: Content) -> MeshSpace:
    """The space of a scene, see `MeshSpace`; of equal triangles the same one."""
    return MeshSpace(content=content, hiding=hiding)
