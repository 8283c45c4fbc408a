"""Armchairs, sofas and ottomans: soft bodies with cushions."""

import numpy as np

from dataset_builder.assets.procedural import materials
from dataset_builder.assets.procedural.fittings import round_leg, square_leg
from dataset_builder.assets.procedural.parts import (
    GAP,
    Made,
    Part,
    Span,
    block,
    facing_front,
    leaning,
    mirrored,
    moved,
    padding,
    rod,
)
from dataset_builder.assets.procedural.round_solids import disc, turned
from dataset_builder.assets.procedural.seating import round_pad
from dataset_builder.assets.procedural.soft import pillow

CUSHION, BODY_LOW, BACK = 0.15, 0.12, 0.16
WOODEN_FRAME = 2


def armchair(params: dict[str, float], finish_rng: np.random.Generator, rng: np.random.Generator) -> Made:
    """One seat between arms: upholstered blocks, rolled arms, or an open wooden frame."""
    return sofa({**params, "seats": 1, "pillows": 0}, finish_rng, rng)


def sofa(params: dict[str, float], finish_rng: np.random.Generator, _: np.random.Generator) -> Made:
    """Two to four seats between arms, with loose pillows."""
    finishes = {"cover": materials.cover(finish_rng),
                "legs": materials.one_of(finish_rng, materials.wood, materials.wood, materials.metal),
                "pillow": materials.one_of(finish_rng, materials.linen, materials.velvet)}
    open_frame = params["arms"] == WOODEN_FRAME
    finishes["legs"] = materials.wood(finish_rng) if open_frame else finishes["legs"]
    sides = _wooden_sides(params) if open_frame else _soft_sides(params)
    return [*sides, *_back_and_cushions(params)], finishes


def _inner(params: dict[str, float]) -> Span:
    half = params["width"] / 2 - params["arm_width"] - GAP
    return -half, half


def _arm_height(params: dict[str, float]) -> float:
    return min(params["seat_height"] + 0.20, params["back_height"] - 0.06)


def _arc_steps(params: dict[str, float]) -> int:
    """Facets per eighth of a circle: coarser where there are many cushions, to bound the triangles of a sofa."""
    return 3 if params["seats"] == 1 else 2


def _soft_sides(params: dict[str, float]) -> list[Part]:
    """Upholstered arms down to the legs, and the base between them."""
    half, y, arm = params["width"] / 2, params["depth"] / 2, params["arm_width"]
    top, outer = _arm_height(params), (half - arm, half)
    deck = params["seat_height"] - CUSHION
    legs = [round_leg((half - 0.06, sy * (y - 0.07)), (half - 0.06, sy * (y - 0.07)), (0, BODY_LOW - GAP),
                      (0.026, 0.045), finish="legs", sides=24) for sy in (-1, 1)]
    base = block(_inner(params), (-y + 0.02, y), (BODY_LOW, deck), finish="cover", bevel=0.01)
    if params["arms"] == 0:
        arms = mirrored([padding(outer, (-y, y), (BODY_LOW, top), finish="cover", radius=min(0.04, 0.45 * arm),
                                 arc_steps=_arc_steps(params))])
        return [*arms, base, *mirrored(legs)]
    roll = max(0.5 * arm + 0.012, 0.05)
    wall = block(outer, (-y + 0.015, y), (BODY_LOW, top - 2 * roll), finish="cover", bevel=0.01)
    centre = half - arm + roll
    scroll = rod((centre, -y, top - roll + GAP), (centre, y, top - roll + GAP), roll, finish="cover")
    return [*mirrored([wall, scroll]), base, *mirrored(legs)]


def _wooden_sides(params: dict[str, float]) -> list[Part]:
    """Open frames of square timber left and right, joined by rails that carry the seat."""
    half, y, bevel = params["width"] / 2, params["depth"] / 2, params["bevel"]
    arm = min(params["arm_width"], 0.07)
    timber, top = 0.85 * arm, _arm_height(params)
    x = half - arm / 2
    deck = params["seat_height"] - CUSHION
    front = square_leg((x, -y + arm / 2), (x, -y + arm / 2), (0, top - 0.028), (0.7 * timber, timber), finish="legs",
                       bevel=bevel)
    hind = square_leg((x, y - arm / 2 - 0.05), (x, y - arm / 2 - 0.05), (0, top - 0.028), (0.7 * timber, timber),
                      finish="legs", bevel=bevel)
    rest = block((half - arm, half), (-y - 0.01, y - 0.02), (top - 0.028 + GAP, top), finish="legs", bevel=bevel)
    side = block((x - 0.35 * timber, x + 0.35 * timber), (-y + arm + GAP, y - arm - 0.05 - GAP),
                 (deck - 0.07, deck - 0.01), finish="legs", bevel=bevel)
    inner = half - arm - GAP
    deck_board = block((-inner, inner), (-y + 0.03, y - 0.02), (deck - 0.06, deck), finish="legs", bevel=bevel)
    return [*mirrored([front, hind, rest, side]), deck_board]


def _back_and_cushions(params: dict[str, float]) -> list[Part]:
    """Back, seat cushions, back cushions and loose pillows; all but the seat recline above the deck."""
    open_frame = params["arms"] == WOODEN_FRAME
    arm = min(params["arm_width"], 0.07) if open_frame else params["arm_width"]
    half, y, seat = params["width"] / 2 - arm - 0.002, params["depth"] / 2, params["seat_height"]
    deck, high = seat - CUSHION + GAP, params["back_height"]
    thick = 0.05 if open_frame else BACK * 0.8
    back = padding((-half, half), (y - thick, y), (deck, high), finish="legs" if open_frame else "cover",
                   radius=0.01 if open_frame else 0.05, arc_steps=2)
    rear = y - thick - 0.004
    seats, backs, loose = [], [], []
    count, fine = int(params["seats"]), _arc_steps(params)
    width = 2 * half / count
    for index in range(count):
        x = (-half + index * width + 0.002, -half + (index + 1) * width - 0.002)
        seats.append(padding(x, (-y + 0.01, rear), (deck, seat), finish="cover", radius=0.045, crown=0.16,
                             arc_steps=fine))
        backs.append(padding((x[0] + 0.004, x[1] - 0.004), (rear - 0.155, rear), (seat + 0.012, high - 0.03),
                             finish="cover", radius=0.05, crown=0.18, side="-y", arc_steps=fine))
    for index in range(int(params["pillows"])):
        loose.append(_loose_pillow(-1 if index == 0 else 1, half, rear - 0.157, seat, high))
    return [*seats, *leaning([back, *backs, *loose], above=deck, degrees=params["recline"])]


def _loose_pillow(side: int, half: float, back: float, seat: float, high: float) -> Part:
    """Square pillow upright against the back cushions near one arm."""
    size = float(np.clip(min(0.44, high - seat, 0.8 * half), 0.2, 0.44))
    mesh = pillow((size, size, 0.13), steps=8)
    centre = (side * (half - size / 2 - 0.02), back - 0.066, seat + size / 2 + 0.004)
    return moved(facing_front(Part(mesh=mesh, finish="pillow")), centre)


def ottoman(params: dict[str, float], finish_rng: np.random.Generator, _: np.random.Generator) -> Made:
    """Soft footstool, round or square, on a wooden base with short legs."""
    finishes = {"cover": materials.cover(finish_rng), "legs": materials.frame(finish_rng)}
    return _square_ottoman(params) if params["shape"] else _round_ottoman(params), finishes


def _round_ottoman(params: dict[str, float]) -> list[Part]:
    radius, top = params["width"] / 2, params["height"]
    legs = [round_leg((sx * 0.62 * radius, sy * 0.62 * radius), (sx * 0.56 * radius, sy * 0.56 * radius), (0, 0.10),
                      (0.022, 0.04), finish="legs") for sx in (-1, 1) for sy in (-1, 1)]
    plinth = moved(Part(mesh=disc(radius - 0.02, 0.018, bevel=0.003), finish="legs"), (0, 0, 0.10 + GAP))
    low = 0.118 + 2 * GAP
    arc = np.linspace(-np.pi / 2, np.pi / 2, 13)
    body = np.stack([radius - 0.03 + 0.03 * np.cos(arc),
                     np.where(arc < 0, 0.03, top - 0.09 - low - 0.03) + 0.03 * np.sin(arc)],
                    axis=-1)
    drum = moved(Part(mesh=turned(body), finish="cover"), (0, 0, low))
    pad = moved(Part(mesh=round_pad(radius, 0.09 - GAP), finish="cover"), (0, 0, top - 0.09 + GAP))
    return [*legs, plinth, drum, pad]


def _square_ottoman(params: dict[str, float]) -> list[Part]:
    x, y, top, bevel = params["width"] / 2, params["depth"] / 2, params["height"], params["bevel"]
    legs = [square_leg((sx * (x - 0.05), sy * (y - 0.05)), (sx * (x - 0.05), sy * (y - 0.05)), (0, 0.10 - GAP),
                       (0.028, 0.045), finish="legs", bevel=bevel) for sx in (-1, 1) for sy in (-1, 1)]
    base = block((-x + 0.01, x - 0.01), (-y + 0.01, y - 0.01), (0.10, 0.12), finish="legs", bevel=bevel)
    body = padding((-x + 0.004, x - 0.004), (-y + 0.004, y - 0.004), (0.12 + GAP, top - 0.12 - GAP), finish="cover",
                   radius=0.02)
    pad = padding((-x, x), (-y, y), (top - 0.12, top), finish="cover", radius=0.04, crown=0.2, inner_steps=4)
    return [*legs, base, body, pad]
