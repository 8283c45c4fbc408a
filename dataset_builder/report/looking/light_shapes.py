"""Lights as shapes to look at: lamps of their true size, beams, and symbols for what shines from outside."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from dataset_builder.geometry.light_axes import rectangle_axes
from dataset_builder.geometry.pinhole import sphere_lattice
from dataset_builder.label.scene_plan import IlluminationPlan, LightPlan
from dataset_builder.light_kinds import LIGHT_KINDS, LightName

Illumination = Literal["source", "target"]
COLOURS: dict[Illumination, tuple[int, int, int]] = {"source": (0, 114, 178), "target": (230, 120, 0)}
"""sRGB, of each illumination."""
ROUND = 24
"""Corners of a circle."""
SYMBOL, POINT = 0.3, 0.05
"""Metres: radius of the symbols of what is outside and of a lamp without a size."""
UNITS = {"radiance": "W/(m² sr)", "irradiance": "W/m²", "intensity": "W/sr"}


@dataclass(frozen=True, kw_only=True, eq=False)
class LightShape:
    """One light."""

    light: LightPlan
    of: Illumination
    """The illumination that it belongs to."""
    number: int
    """Its place there, from 0."""
    at: np.ndarray
    """(3,) where it is, or its symbol, metres."""
    positions: np.ndarray
    """(V, 3), metres."""
    faces: np.ndarray
    """(F, 3) into positions."""
    lines: np.ndarray
    """(L, 2, 3) ends of lines: beams, and which way it shines, metres."""

    @property
    def name(self) -> str:
        """`target 0: spot`; of a light that has a name, `target key: spot`."""
        return f"{self.of} {self.light.name or self.number}: {self.light.kind}"

    @property
    def outside(self) -> bool:
        """Whether it shines from no place in the scene, so that a symbol stands for it."""
        return LIGHT_KINDS[self.light.kind].outside

    @property
    def unit(self) -> str:
        """Of its radiance."""
        return UNITS[LIGHT_KINDS[self.light.kind].quantity]


class SymbolPlaces(NamedTuple):
    """What symbols are put around."""

    centre: np.ndarray
    """(3,) middle of the target's box."""
    low: np.ndarray
    high: np.ndarray
    """(3,) corners of what is shown."""
    aside: np.ndarray = np.zeros(2)
    """(2,) how far along x and y symbols above all are moved from the middle."""


class _Drawn(NamedTuple):
    at: np.ndarray
    positions: np.ndarray
    faces: np.ndarray
    lines: np.ndarray


NO_FACES, NO_LINES = np.zeros((0, 3), int), np.zeros((0, 2, 3))


def light_shapes(illumination: IlluminationPlan, of: Illumination,
                 stage: SymbolPlaces) -> tuple[LightShape, ...]:
    """Every light of an illumination, in its order."""
    return tuple(LightShape(light=light, of=of, number=number, **_MAKERS[light.kind](light, stage)._asdict())
                 for number, light in enumerate(illumination.lights))


def _area(light: LightPlan, _: SymbolPlaces) -> _Drawn:
    at, (first, second) = np.array(light.position), rectangle_axes(light.direction, light.turn)
    a, b = first * light.size / 2, second * (light.length or light.size) / 2
    corners = at + np.array([-a - b, a - b, a + b, b - a])
    return _Drawn(at, corners, np.array([[0, 1, 2], [0, 2, 3]]), _arrow(at, light, max(light.size, light.length)))


def _disk(light: LightPlan, _: SymbolPlaces) -> _Drawn:
    at = np.array(light.position)
    rim = at + light.size * _circle(light)
    return _Drawn(at, np.vstack([at, rim]), _fan(), _arrow(at, light, light.size))


def _cylinder(light: LightPlan, _: SymbolPlaces) -> _Drawn:
    at, half = np.array(light.position), np.array(light.direction) * light.length / 2
    rim = light.size * _circle(light)
    k, after = np.arange(ROUND), (np.arange(ROUND) + 1) % ROUND
    faces = np.vstack([np.stack([k, after, after + ROUND], 1), np.stack([k, after + ROUND, k + ROUND], 1)])
    return _Drawn(at, np.vstack([at - half + rim, at + half + rim]), faces, NO_LINES)


def _sphere(light: LightPlan, _: SymbolPlaces) -> _Drawn:
    return _ball(np.array(light.position), light.size)


def _point(light: LightPlan, _: SymbolPlaces) -> _Drawn:
    at = np.array(light.position)
    rays = sphere_lattice(14)
    return _ball(at, POINT)._replace(lines=np.stack([at + 1.5 * POINT * rays, at + 3 * POINT * rays], axis=1))


def _spot(light: LightPlan, stage: SymbolPlaces) -> _Drawn:
    """A small cone, and the edge of the beam as far as the target."""
    at, along = np.array(light.position), np.array(light.direction)
    spread = along + np.tan(np.radians(min(light.cutoff, 80.0))) * _circle(light)
    reach = max(float(np.dot(stage.centre - at, along)), 3 * POINT)
    lines = np.stack([np.broadcast_to(at, (ROUND, 3))[::4], (at + reach * spread)[::4]], axis=1)
    rim = np.stack([at + reach * spread, np.roll(at + reach * spread, -1, axis=0)], axis=1)
    return _Drawn(at, np.vstack([at, at + 2 * POINT * spread]), _fan(), np.concatenate([lines, rim]))


def _dome(_: LightPlan, stage: SymbolPlaces) -> _Drawn:
    """A small hemisphere of wires above all, beside that of the other illumination."""
    at = np.array([*(stage.low[:2] + stage.high[:2]) / 2, stage.high[2] + 2 * SYMBOL])
    at[:2] += stage.aside
    turn, rise = np.linspace(0, 2 * np.pi, ROUND + 1), np.linspace(0, np.pi, ROUND // 2 + 1)
    arcs = [np.stack([np.cos(turn), np.sin(turn), 0 * turn], 1) * scale + (0, 0, up)
            for scale, up in ((1.0, 0.0), (np.sqrt(0.75), 0.5))]
    arcs += [np.stack([np.cos(rise) * np.cos(a), np.cos(rise) * np.sin(a), np.sin(rise)], 1)
             for a in np.arange(4) * np.pi / 4]
    lines = np.concatenate([np.stack([arc[:-1], arc[1:]], axis=1) for arc in arcs])
    return _Drawn(at, np.zeros((0, 3)), NO_FACES, at + SYMBOL * lines)


def _sun(light: LightPlan, stage: SymbolPlaces) -> _Drawn:
    """A ball outside of all, and an arrow from it to the target."""
    along = np.array(light.direction)
    at = stage.centre - along * (np.linalg.norm(stage.high - stage.low) / 2 + SYMBOL)
    shaft = np.array([[at, stage.centre]])
    return _ball(at, SYMBOL)._replace(lines=np.concatenate([shaft, _head(stage.centre, along, SYMBOL)]))


def _ball(at: np.ndarray, radius: float) -> _Drawn:
    """A ball of triangles: rings of ROUND corners between two poles."""
    rise = np.linspace(0, np.pi, ROUND // 2 + 1)[1:-1, None]
    turn = np.arange(ROUND) * 2 * np.pi / ROUND
    rings = np.stack([np.sin(rise) * np.cos(turn), np.sin(rise) * np.sin(turn), np.cos(rise) + 0 * turn], -1)
    corners = np.vstack([rings.reshape(-1, 3), [0, 0, 1], [0, 0, -1]])
    k, after = np.arange(ROUND), (np.arange(ROUND) + 1) % ROUND
    north, count = len(corners) - 2, len(rise)
    sides = [np.stack([base + k, base + ROUND + k, base + ROUND + after], 1) for base in ROUND * np.arange(count - 1)]
    sides += [np.stack([base + k, base + ROUND + after, base + after], 1) for base in ROUND * np.arange(count - 1)]
    last = ROUND * (count - 1)
    caps = [np.stack([0 * k + north, k, after], 1), np.stack([0 * k + north + 1, last + after, last + k], 1)]
    return _Drawn(at, at + radius * corners, np.concatenate([*sides, *caps]), NO_LINES)


def _circle(light: LightPlan) -> np.ndarray:
    """(ROUND, 3) unit vectors square to a light's direction."""
    first, second = rectangle_axes(light.direction, 0.0)
    turn = np.arange(ROUND)[:, None] * 2 * np.pi / ROUND
    return np.asarray(np.cos(turn) * first + np.sin(turn) * second)


def _fan() -> np.ndarray:
    """(ROUND, 3) faces of a middle, 0, and the circle after it."""
    k = np.arange(ROUND)
    return np.stack([0 * k, 1 + k, 1 + (k + 1) % ROUND], axis=1)


def _arrow(at: np.ndarray, light: LightPlan, length: float) -> np.ndarray:
    """(5, 2, 3) lines that say which way a lamp shines."""
    along = np.array(light.direction)
    tip = at + along * max(length, 3 * POINT)
    return np.concatenate([[[at, tip]], _head(tip, along, 2 * POINT)])


def _head(tip: np.ndarray, along: np.ndarray, size: float) -> np.ndarray:
    """(4, 2, 3) lines of an arrow's head."""
    first, second = rectangle_axes(tuple(along), 0.0)
    return np.array([[tip, tip - size * (along + side / 2)] for side in (first, -first, second, -second)])


_MAKERS: dict[LightName, Callable[[LightPlan, SymbolPlaces], _Drawn]] = {
    "dome": _dome, "sun": _sun, "area": _area, "sphere": _sphere, "point": _point, "spot": _spot, "disk": _disk,
    "cylinder": _cylinder,
}
