"""Parts that many pieces share: legs, handles, drawer and door fronts, and books."""

from dataclasses import replace

import numpy as np

from dataset_builder.assets.procedural.parts import GAP, Part, Span, block, facing_front, moved, rod
from dataset_builder.assets.procedural.round_solids import COARSE, chamfered_square, circle, disc, post, turned

FRONT_GAP = 0.003
"""Metres between neighbouring doors and drawers."""
HANDLE_SIDES = 16
"""Sides of handles: 22.5 degrees from one to the next still count as round, and they are a few millimetres thick."""
PAPER = (0.5 / 8, 0.5 / 8)
"""Where the book cloth has the colour of paper."""


def square_leg(bottom: tuple[float, float], top: tuple[float, float], heights: Span, thickness: Span, *, finish: str,
               bevel: float) -> Part:
    """Leg of square section from `bottom` to `top` (x, y), with its thickness below and above."""
    path = np.array([(*bottom, heights[0]), (*top, heights[1])])
    section = chamfered_square(2 * bevel / max(thickness))
    return Part(mesh=post(section, path, np.array(thickness) / 2, bevel=bevel), finish=finish)


def round_leg(bottom: tuple[float, float], top: tuple[float, float], heights: Span, diameters: Span, *, finish: str,
              bevel: float = 0.002, sides: int = COARSE) -> Part:
    """Leg of round section from `bottom` to `top` (x, y), with its diameter below and above."""
    path = np.array([(*bottom, heights[0]), (*top, heights[1])])
    return Part(mesh=post(circle(sides), path, np.array(diameters) / 2, bevel=bevel), finish=finish)


def handle(centre: tuple[float, float], front: float, *, style: int, finish: str, upright: bool = False,
           length: float = 0.12) -> list[Part]:
    """Bar (style 0) or knob (style 1) at `centre` (x, z) on a face whose outside is at y = `front`."""
    x, z = centre
    if style == 1:
        profile = np.array([(0.007, 0), (0.006, 0.012), (0.013, 0.017), (0.015, 0.021), (0.0145, 0.026),
                            (0.011, 0.029)])
        knob = facing_front(Part(mesh=turned(profile, sides=HANDLE_SIDES + 4), finish=finish))
        return [moved(knob, (x, front - GAP, z))]
    along = np.array([0.0, 0, 1]) if upright else np.array([1.0, 0, 0])
    middle = np.array([x, front - 0.030, z])
    grip = rod(middle - along * length / 2, middle + along * length / 2, 0.005, finish=finish, sides=HANDLE_SIDES)
    feet = [rod(middle + side * along * 0.36 * length + (0, 0.030 - GAP, 0),
                middle + side * along * 0.36 * length + (0, 0.005 + GAP, 0), 0.004, finish=finish, sides=HANDLE_SIDES)
            for side in (-1, 1)]
    return [grip, *feet]


def panel_front(x: Span, z: Span, front: float, *, framed: bool, finish: str, bevel: float,
                grain: int = 0) -> tuple[list[Part], float]:
    """Drawer or door front in the given spans, 20 mm thick behind y = `front`; flat, or framed around a panel.

    Returns its parts and the y of the face that a handle at the middle stands on.
    """
    depth = (front, front + 0.02)
    stile = min(0.06, (x[1] - x[0]) / 4, (z[1] - z[0]) / 4)
    if not framed or stile < 0.025:
        return [block(x, depth, z, finish=finish, bevel=bevel, grain=grain)], front
    inner_x, inner_z = (x[0] + stile, x[1] - stile), (z[0] + stile, z[1] - stile)
    uprights = [block(side, depth, z, finish=finish, bevel=bevel, grain=2)
                for side in ((x[0], inner_x[0] - GAP), (inner_x[1] + GAP, x[1]))]
    rails = [block(inner_x, depth, side, finish=finish, bevel=bevel, grain=0)
             for side in ((z[0], inner_z[0] - GAP), (inner_z[1] + GAP, z[1]))]
    field = block(inner_x, (front + 0.009, front + 0.02), inner_z, finish=finish, bevel=bevel, grain=grain)
    return [*uprights, *rails, field], front + 0.009


def drawer(x: Span, z: Span, front: float, *, style: int, framed: bool, finish: str, metal: str,
           bevel: float) -> list[Part]:
    """Drawer front with its handle; wide ones have two."""
    parts, face = panel_front(x, z, front, framed=framed, finish=finish, bevel=bevel)
    width = x[1] - x[0]
    places = (0.25, 0.75) if width > 0.75 else (0.5,)
    for share in places:
        parts += handle((x[0] + share * width, (z[0] + z[1]) / 2), face, style=style, finish=metal,
                        length=min(0.14, 0.4 * width))
    return parts


def door(x: Span, z: Span, front: float, *, hinge_left: bool, style: int, framed: bool, finish: str, metal: str,
         bevel: float) -> list[Part]:
    """Door with its handle away from the hinge, on the frame where it has one."""
    parts, _ = panel_front(x, z, front, framed=framed, finish=finish, bevel=bevel, grain=2)
    inset = min(0.035, (x[1] - x[0]) / 6)
    at = x[1] - inset if hinge_left else x[0] + inset
    height = z[0] + (0.5 if z[1] - z[0] > 1.0 else 0.72) * (z[1] - z[0])
    return parts + handle((at, height), front, style=style, finish=metal, upright=True,
                          length=min(0.16, 0.5 * (z[1] - z[0])))


def split(span: Span, count: int, gap: float = FRONT_GAP) -> list[Span]:
    """`count` equal spans side by side in `span`, `gap` apart."""
    width = (span[1] - span[0] - gap * (count - 1)) / count
    return [(span[0] + k * (width + gap), span[0] + k * (width + gap) + width) for k in range(count)]


def _patch(rng: np.random.Generator) -> tuple[float, float]:
    """Middle of one of the eight by eight patches of the book cloth."""
    column, row = rng.integers(8, size=2)
    return (column + 0.5) / 8, (row + 0.5) / 8


def standing_books(x: Span, floor: float, headroom: float, depth: Span, fill: float, rng: np.random.Generator, *,
                   bevel: float) -> list[Part]:
    """Books upright from the left of `x` on, on `floor`, in runs with gaps, filling about `fill` of the length."""
    parts: list[Part] = []
    at = x[0] + 0.01 + 0.25 * (1 - fill) * (x[1] - x[0]) * rng.uniform()
    stop = at + fill * (x[1] - x[0])
    while True:
        width, height = rng.uniform(0.016, 0.045), min(headroom * rng.uniform(0.62, 0.90), 0.31)
        deep = min(rng.uniform(0.14, 0.21), depth[1] - depth[0] - 0.02)
        if at + width > min(stop, x[1] - 0.005):
            return parts
        y = depth[0] + 0.012 + rng.uniform(0, 0.008)
        book = block((at, at + width), (y, y + deep), (floor + GAP, floor + height), finish="books", bevel=bevel)
        parts.append(replace(book, patch=_patch(rng)))
        at += width + GAP + (rng.uniform(0.02, 0.10) if rng.uniform() < 0.12 else 0.0)


def lying_books(count: int, place: tuple[float, float], floor: float, rng: np.random.Generator, *,
                room: float) -> list[Part]:
    """A pile of `count` books at `place` (x, y), the largest below, at most `room` metres wide."""
    parts: list[Part] = []
    low = floor + GAP
    for index in range(count):
        thick, size = rng.uniform(0.02, 0.04), min(room, rng.uniform(0.23, 0.29) - 0.025 * index)
        x, y = np.asarray(place) + rng.uniform(-0.012, 0.012, size=2)
        half, deep = size / 2, 0.37 * size
        parts += _lying_book((x - half, x + half), (y - deep, y + deep), (low, low + thick), _patch(rng))
        low += thick + GAP
    return parts


def _lying_book(x: Span, y: Span, z: Span, patch: tuple[float, float]) -> list[Part]:
    """Book with its spine to the front: two boards and a spine around a block of paper that is a little smaller."""
    board, inset = 0.003, 0.004
    inside = (z[0] + board + GAP, z[1] - board - GAP)
    cloth = [block(x, y, span, finish="books", bevel=0.001) for span in ((z[0], z[0] + board), (z[1] - board, z[1]))]
    cloth.append(block(x, (y[0], y[0] + board), inside, finish="books", bevel=0.001))
    paper = block((x[0] + inset, x[1] - inset), (y[0] + board + GAP, y[1] - inset), inside, finish="books", bevel=0.001)
    return [*(replace(part, patch=patch) for part in cloth), replace(paper, patch=PAPER)]


def foot_disc(place: tuple[float, float], heights: Span, diameter: float, *, finish: str) -> Part:
    """Short round foot."""
    mesh = disc(diameter / 2, heights[1] - heights[0], bevel=0.002, sides=COARSE)
    return moved(Part(mesh=mesh, finish=finish), (*place, heights[0]))
