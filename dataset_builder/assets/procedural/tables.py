"""Dining tables, coffee tables and desks."""

import numpy as np

from dataset_builder.assets.procedural import materials
from dataset_builder.assets.procedural.fittings import drawer, lying_books, round_leg, split, square_leg
from dataset_builder.assets.procedural.parts import GAP, Made, Part, block, mirrored, moved
from dataset_builder.assets.procedural.round_solids import disc, turned


def _board(params: dict[str, float], *, widest: float, finish: str = "top") -> tuple[Part, float, float]:
    """Table top, rectangular or round, and its half extents in x and y."""
    low, bevel = params["height"] - params["thickness"], max(params["bevel"], 0.002)
    if params["shape"]:
        radius = min(params["width"], widest) / 2
        top = moved(Part(mesh=disc(radius, params["thickness"], bevel=bevel, sides=64), finish=finish), (0, 0, low))
        return top, radius, radius
    x, y = params["width"] / 2, min(params["depth"], params["width"]) / 2
    return block((-x, x), (-y, y), (low, params["height"]), finish=finish, bevel=bevel), x, y


def dining_table(params: dict[str, float], finish_rng: np.random.Generator, _: np.random.Generator) -> Made:
    """Table on square tapered legs with aprons, splayed round legs, or a pedestal (round) or trestles (rectangular)."""
    frame = materials.frame(finish_rng)
    top = frame if finish_rng.uniform() < 0.6 else materials.one_of(finish_rng, materials.wood, materials.stone)
    finishes = {"frame": frame, "top": top}
    board, x, y = _board(params, widest=1.4)
    base = (_square_base, _splayed_base, _pedestal if params["shape"] else _trestles)[int(params["base"])]
    return [board, *base(params, x, y)], finishes


def _leg_place(params: dict[str, float], x: float, y: float, inset: float) -> tuple[float, float]:
    """Where a corner leg stands: near the corner of a rectangle, or on the diagonal of a circle."""
    share = 0.62 if params["shape"] else 1.0
    return share * x - inset, share * y - inset


def _square_base(params: dict[str, float], x: float, y: float) -> list[Part]:
    leg, bevel = params["leg"], params["bevel"]
    under = params["height"] - params["thickness"] - GAP
    px, py = _leg_place(params, x, y, leg / 2 + (0.02 if not params["shape"] else 0.0))
    legs = [square_leg((sx * px, sy * py), (sx * px, sy * py), (0, under), (0.6 * leg, leg), finish="frame",
                       bevel=bevel)
            for sx in (-1, 1) for sy in (-1, 1)]
    span, half = (under - 0.085, under), 0.012
    long_aprons = [block((-px + leg / 2 + GAP, px - leg / 2 - GAP), (sy * py - half, sy * py + half), span,
                         finish="frame", bevel=bevel) for sy in (-1, 1)]
    short_aprons = [block((sx * px - half, sx * px + half), (-py + leg / 2 + GAP, py - leg / 2 - GAP), span,
                          finish="frame", bevel=bevel) for sx in (-1, 1)]
    return [*legs, *long_aprons, *short_aprons]


def _splayed_base(params: dict[str, float], x: float, y: float) -> list[Part]:
    leg, bevel = params["leg"], params["bevel"]
    under = params["height"] - params["thickness"] - GAP
    px, py = _leg_place(params, x, y, 0.10 if not params["shape"] else 0.02)
    out = 0.07
    legs = [round_leg((sx * (px + out), sy * (py + out)), (sx * px, sy * py), (0, under - 0.03 - GAP),
                      (0.45 * leg, 0.9 * leg), finish="frame") for sx in (-1, 1) for sy in (-1, 1)]
    rails = [block((sx * px - 0.04, sx * px + 0.04), (-py - 0.04, py + 0.04), (under - 0.03, under), finish="frame",
                   bevel=bevel, grain=1) for sx in (-1, 1)]
    return [*legs, *rails]


def _pedestal(params: dict[str, float], x: float, y: float) -> list[Part]:
    under = params["height"] - params["thickness"] - GAP
    foot, neck = 0.58 * x, 0.55 * params["leg"]
    rise = np.linspace(0, 1, 14)
    flare = np.stack([neck + (foot - neck) * (1 - rise) ** 3, 0.022 + 0.20 * rise**0.8], axis=-1)
    crown = np.linspace(0, 1, 8)
    head = np.stack([neck + (0.28 * x - neck) * crown**2.2, under - 0.10 + 0.10 * crown], axis=-1)
    profile = np.concatenate([[(foot - 0.004, 0.0), (foot, 0.004)], flare, head])
    return [Part(mesh=turned(profile), finish="frame")]


def _trestles(params: dict[str, float], x: float, y: float) -> list[Part]:
    leg, bevel = params["leg"], params["bevel"]
    under = params["height"] - params["thickness"] - GAP
    at, deep = 0.68 * x, 0.82 * y
    side = (at - leg / 2, at + leg / 2)
    foot = block(side, (-deep, deep), (0, 0.05), finish="frame", bevel=max(bevel, 0.005), grain=1)
    head = block(side, (-deep, deep), (under - 0.05, under), finish="frame", bevel=bevel, grain=1)
    column = block((at - 0.4 * leg, at + 0.4 * leg), (-0.32 * y, 0.32 * y), (0.05 + GAP, under - 0.05 - GAP),
                   finish="frame", bevel=bevel, grain=2)
    beam = block((-at + 0.4 * leg + GAP, at - 0.4 * leg - GAP), (-0.02, 0.02), (0.30, 0.39), finish="frame",
                 bevel=bevel)
    return [*mirrored([foot, head, column]), beam]


def coffee_table(params: dict[str, float], finish_rng: np.random.Generator, book_rng: np.random.Generator) -> Made:
    """Low table: round or rectangular, wooden or stone top, wooden or metal legs, a shelf and books if asked for."""
    finishes = {"frame": materials.one_of(finish_rng, materials.wood, materials.metal),
                "top": materials.one_of(finish_rng, materials.wood, materials.stone),
                "books": materials.books(finish_rng)}
    board, x, y = _board(params, widest=1.1)
    leg, under = params["leg"], params["height"] - params["thickness"] - GAP
    px, py = _leg_place(params, x, y, leg / 2 + 0.015)
    legs = [square_leg((sx * px, sy * py), (sx * px, sy * py), (0, under), (0.8 * leg, leg), finish="frame",
                       bevel=params["bevel"]) for sx in (-1, 1) for sy in (-1, 1)]
    parts = [board, *legs, *_coffee_rails(params, px, py, under)]
    if params["books"]:
        parts += lying_books(int(params["books"]), (0.35 * x, 0.2 * y), params["height"], book_rng, room=0.8 * y)
    return parts, finishes


def _coffee_rails(params: dict[str, float], px: float, py: float, under: float) -> list[Part]:
    """Rails below the top, and the shelf, which rests between the legs."""
    leg, bevel = params["leg"], params["bevel"]
    span, half = (under - 0.03, under), 0.3 * leg
    rails = [block((-px + leg / 2 + GAP, px - leg / 2 - GAP), (sy * py - half, sy * py + half), span, finish="frame",
                   bevel=bevel)
             for sy in (-1, 1)]
    rails += [block((sx * px - half, sx * px + half), (-py + leg / 2 + GAP, py - leg / 2 - GAP), span, finish="frame",
                    bevel=bevel) for sx in (-1, 1)]
    if not params["shelf"]:
        return rails
    shelf = block((-px + leg / 2 + GAP, px - leg / 2 - GAP), (-py, py), (0.30 * under, 0.30 * under + 0.018),
                  finish="top", bevel=bevel)
    return [*rails, shelf]


def desk(params: dict[str, float], finish_rng: np.random.Generator, _: np.random.Generator) -> Made:
    """Writing desk: a chest of drawers on one side, two legs on the other, a modesty panel behind."""
    finishes = {"frame": materials.wood(finish_rng), "front": materials.frame(finish_rng),
                "metal": materials.metal(finish_rng)}
    x, y, bevel = params["width"] / 2, params["depth"] / 2, params["bevel"]
    low = params["height"] - params["thickness"]
    under = low - GAP
    board = block((-x, x), (-y, y), (low, params["height"]), finish="frame", bevel=max(bevel, 0.003))
    legs = [square_leg((x - 0.045, sy * (y - 0.045)), (x - 0.045, sy * (y - 0.045)), (0, under), (0.032, 0.05),
                       finish="frame", bevel=bevel) for sy in (-1, 1)]
    chest_width = min(0.44, 0.4 * params["width"])
    chest = _chest(params, (-x + 0.02, -x + 0.02 + chest_width), (-y + 0.03, y - 0.03), under)
    panel = block((-x + 0.02 + chest_width + GAP, x - 0.07 - GAP), (y - 0.06, y - 0.044), (0.42 * under, under),
                  finish="frame", bevel=bevel, grain=0)
    parts = [board, *legs, *chest, panel]
    return parts if not params["side"] else mirrored(parts)[len(parts):], finishes


def _chest(params: dict[str, float], x: tuple[float, float], y: tuple[float, float], high: float) -> list[Part]:
    """Carcass on four feet, with drawers in front."""
    bevel, wall = params["bevel"], 0.018
    front = y[0] + 0.02 + GAP
    low = 0.07
    feet = [square_leg((fx, fy), (fx, fy), (0, low - GAP), (0.026, 0.036), finish="frame", bevel=bevel)
            for fx in (x[0] + 0.03, x[1] - 0.03) for fy in (front + 0.03, y[1] - 0.03)]
    sides = [block(side, (front, y[1]), (low, high), finish="frame", bevel=bevel, grain=2)
             for side in ((x[0], x[0] + wall), (x[1] - wall, x[1]))]
    inner = (x[0] + wall + GAP, x[1] - wall - GAP)
    plates = [block(inner, (front, y[1]), z, finish="frame", bevel=bevel, grain=0)
              for z in ((low, low + wall), (high - wall, high))]
    back = block(inner, (y[1] - 0.01, y[1]), (low + wall + GAP, high - wall - GAP), finish="frame", bevel=0.001,
                 grain=2)
    fronts = [part for z in split((low + 0.002, high - 0.004), int(params["drawers"]))
              for part in drawer((x[0] + 0.001, x[1] - 0.001), z, y[0], style=int(params["handle"]), framed=False,
                                 finish="front", metal="metal", bevel=bevel)]
    return [*feet, *sides, *plates, back, *fronts]
