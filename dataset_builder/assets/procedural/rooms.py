"""Rooms: floor, walls with window openings, skirting and trim, ceiling; no light gets in except through the windows."""

from collections.abc import Callable

import numpy as np

from dataset_builder.assets.asset import Asset
from dataset_builder.assets.procedural import materials
from dataset_builder.assets.procedural.boxes import plate, with_uvs
from dataset_builder.assets.procedural.parts import (
    GAP,
    Finish,
    Part,
    Span,
    assemble_in_place,
    block,
    moved,
    turned_about_z,
)
from dataset_builder.errors import UserError
from dataset_builder.geometry.mesh import TriangleMesh, concatenate
from dataset_builder.seeding import rng

THICKNESS = 0.10
"""Of walls, floor and ceiling, all outside the room's interior."""
SILL_HEIGHT, LINTEL_HEIGHT = 0.90, 2.15
PANE_INSET, PANE_DEPTH = 0.025, 0.055
"""Metres from the edge of a window's opening to its pane (twice that above the sill), so that it ends inside the
frame, and from the inside of the wall."""
PANE_FACES = np.array([[0, 1, 2], [0, 2, 3]])
SIDES = (("+y", 0), ("-x", 90), ("+x", -90), ("-y", 180))
"""Walls in the order in which they get windows, and the turn about +Z that brings a wall from +Y to its place."""


def make_room(*, width: float, depth: float, height: float, ceiling: bool, windows: int, skirting: float,
              seed: int, finish: Callable[[str, Finish], Finish] | None = None) -> dict[str, Asset]:
    """Assets `floor`, `walls` and, if asked for, `ceiling`, in the room's frame.

    The interior is x in [-width/2, width/2], y in [-depth/2, depth/2], z in [0, height], in metres (at least
    1, 1 and 1.5). `windows` walls (0 to 4: +Y, -X, +X, -Y) have an opening with frame and sill, without glass, which
    `make_panes` adds.
    `skirting` is the height of the skirting board, 0 for none. Boards stand out by 1.5 cm, sills by 4 cm.
    `finish` gives the finish of `floor`, `wall`, `trim` and `ceiling` from its name and what is drawn for it; it moves
    no draw. Raises UserError for sizes that make no room.
    """
    if not (width >= 1 and depth >= 1 and height >= 1.5 and 0 <= windows <= 4 and 0 <= skirting <= height / 2):
        raise UserError("room: expected width and depth >= 1, height >= 1.5, 0 to 4 windows and skirting in "
                        f"[0, height / 2], got {width:g}, {depth:g}, {height:g}, {windows}, {skirting:g}")
    finish_rng, floor_rng, wall_rng, ceiling_rng = rng(seed, "room").spawn(4)
    wall, trim = materials.plaster(finish_rng), materials.paint(finish_rng, "white")
    finishes = {"floor": materials.floor(finish_rng), "wall": wall, "trim": trim,
                "ceiling": materials.plaster(finish_rng, "white")}
    if finish is not None:
        finishes = {name: finish(name, drawn) for name, drawn in finishes.items()}
    extent = ((-width / 2 - THICKNESS, width / 2 + THICKNESS), (-depth / 2 - THICKNESS, depth / 2 + THICKNESS))
    walls = [part for index, (_, turn) in enumerate(SIDES)
             for part in _wall(*_wall_size(index, width, depth), height, window=index < windows, skirting=skirting,
                               turn=turn)]
    room = {"floor": _room_part("floor", [_slab(extent, (-THICKNESS, 0.0), "floor")], finishes, floor_rng),
            "walls": _room_part("walls", walls, finishes, wall_rng)}
    if ceiling:
        room["ceiling"] = _room_part("ceiling", [_slab(extent, (height, height + THICKNESS), "ceiling")], finishes,
                                     ceiling_rng)
    return room


def make_panes(*, width: float, depth: float, height: float, windows: int, skirting: float) -> Asset:
    """The panes of a room of at least one window: one upright sheet of thin clear glass in each window's frame.

    A sheet without thickness, facing the room; it ends inside the frame and runs through its bars. The numbers are
    those of `make_room`.
    """
    panes = [_pane(*_wall_size(index, width, depth)[:2], height, skirting, turn)
             for index, (_, turn) in enumerate(SIDES[:windows])]
    return Asset(name="panes", category="room", mesh=concatenate(panes), materials=(materials.pane().material,),
                 meta={"licence": "CC0-1.0", "source": "procedural"})


def window_holes(*, width: float, depth: float, height: float, windows: int, skirting: float) -> list[np.ndarray]:
    """Where the windows of a room end outside: of each a (3, 3) corner, and its sides to the right and upwards as they
    are seen from inside, metres. The numbers are those of `make_room`."""
    return [_hole(*_wall_size(index, width, depth)[:2], height, skirting, turn)
            for index, (_, turn) in enumerate(SIDES[:windows])]


def _hole(length: float, distance: float, height: float, skirting: float, turn: float) -> np.ndarray:
    """The hole in a wall's outer face, as if in +Y, then turned."""
    (left, right), (low, high) = _opening(length, height, skirting)
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    hole = np.array([(left, distance + THICKNESS, low), (right - left, 0, 0), (0, 0, high - low)])
    return np.asarray(hole @ np.array([(c, s, 0), (-s, c, 0), (0, 0, 1.0)]))


def _pane(length: float, distance: float, height: float, skirting: float, turn: float) -> TriangleMesh:
    """The sheet of a wall's window, made as if in +Y, then turned; coordinates in metres."""
    (left, right), (low, high) = _opening(length, height, skirting)
    x, z = (left + PANE_INSET, right - PANE_INSET), (low + 2 * PANE_INSET, high - PANE_INSET)
    corners = np.array([(x[0], distance + PANE_DEPTH, z[0]), (x[1], distance + PANE_DEPTH, z[0]),
                        (x[1], distance + PANE_DEPTH, z[1]), (x[0], distance + PANE_DEPTH, z[1])])
    sheet = with_uvs(corners, PANE_FACES, corners[PANE_FACES][..., [0, 2]])
    return turned_about_z(Part(mesh=sheet, finish="pane"), turn).mesh


def _room_part(name: str, parts: list[Part], finishes: dict[str, Finish], stream: np.random.Generator) -> Asset:
    return assemble_in_place(parts, finishes, name=name, category="room", rng=stream)


def _slab(extent: tuple[Span, Span], z: Span, finish: str) -> Part:
    """Floor or ceiling, reaching under or over the walls; grain along the room's depth."""
    return block(*extent, z, finish=finish, bevel=0.001, grain=1)


def _wall_size(index: int, width: float, depth: float) -> tuple[float, float, bool]:
    """Inner length, distance from the room's centre, and whether the wall also closes its two corners."""
    along_x = index in (0, 3)
    return (width, depth / 2, True) if along_x else (depth, width / 2, False)


def _wall(length: float, distance: float, corners: bool, height: float, *, window: bool, skirting: float,
          turn: float) -> list[Part]:
    """One wall made as if it were +Y, then turned: plate, skirting, and window frame with sill."""
    half = length / 2
    outer = half + THICKNESS if corners else half - GAP
    opening = _opening(length, height, skirting) if window else None
    xs = np.array([-outer, *(opening[0] if opening else ()), outer])
    zs = np.array([0.0, *(opening[1] if opening else ()), height])
    cells = np.ones((len(xs) - 1, len(zs) - 1), dtype=bool)
    if opening:
        cells[1, 1] = False
    sheet = Part(mesh=plate(cells, xs, zs, thickness=THICKNESS), finish="wall")
    parts = [moved(sheet, (0, distance, 0))]
    if skirting > 0:
        reach = half - GAP if corners else half - 0.015 - 2 * GAP
        parts.append(block((-reach, reach), (distance - 0.015, distance - GAP), (GAP, skirting), finish="trim",
                           bevel=0.005))
    if opening:
        parts += _window(*opening, distance)
    return [turned_about_z(part, turn) for part in parts]


def _opening(length: float, height: float, skirting: float) -> tuple[Span, Span]:
    """Spans of a window in the middle of a wall: at most 1.8 m wide, at the usual height where the room allows."""
    half = min(0.9, 0.3 * length)
    low = max(min(SILL_HEIGHT, 0.36 * height), skirting + 0.05)
    high = max(min(LINTEL_HEIGHT, height - 0.25), low + 0.2)
    return (-half, half), (low, min(high, height - 0.05))


def _window(x: Span, z: Span, distance: float) -> list[Part]:
    """Frame in the opening, a post and a bar across it, and a sill that stands out into the room."""
    deep, bar = (distance + 0.03, distance + 0.08), 0.05
    z_low = z[0] + 0.025 + GAP
    edge = (x[0] + GAP, x[1] - GAP)
    sides = [block(span, deep, (z_low, z[1] - GAP), finish="trim", bevel=0.004, grain=2)
             for span in ((edge[0], edge[0] + bar), (edge[1] - bar, edge[1]))]
    inner = (edge[0] + bar + GAP, edge[1] - bar - GAP)
    rails = [block(inner, deep, span, finish="trim", bevel=0.004)
             for span in ((z_low, z_low + bar), (z[1] - GAP - bar, z[1] - GAP))]
    pane = (z_low + bar + GAP, z[1] - 2 * GAP - bar)
    thin = (distance + 0.04, distance + 0.07)
    post = block((-0.02, 0.02), thin, pane, finish="trim", bevel=0.004, grain=2)
    level = pane[0] + 0.66 * (pane[1] - pane[0])
    across = [block(span, thin, (level - 0.014, level + 0.014), finish="trim", bevel=0.003)
              for span in ((inner[0], -0.02 - GAP), (0.02 + GAP, inner[1]))]
    sill = block(edge, (distance - 0.04, distance + 0.09), (z[0] + GAP, z[0] + 0.025), finish="trim", bevel=0.004)
    return [*sides, *rails, post, *across, sill]
