"""Cabinets, bookshelves, wardrobes and nightstands: carcasses of boards with fronts, shelves and books."""

import numpy as np

from dataset_builder.assets.procedural import materials
from dataset_builder.assets.procedural.fittings import door, drawer, lying_books, round_leg, split, standing_books
from dataset_builder.assets.procedural.parts import GAP, Made, Part, Span, block

WALL = 0.02
FRONT = 0.02
WIDEST_DOOR = 0.62
"""Bays wider than this have two doors."""


def carcass(x: Span, y: Span, z: Span, *, wall: float, finish: str, bevel: float) -> list[Part]:
    """Open box of boards: sides between top and bottom, and a thin back."""
    inner_z = (z[0] + wall + GAP, z[1] - wall - GAP)
    plates = [block(x, y, span, finish=finish, bevel=bevel, grain=0)
              for span in ((z[0], z[0] + wall), (z[1] - wall, z[1]))]
    sides = [block(span, y, inner_z, finish=finish, bevel=bevel, grain=2)
             for span in ((x[0], x[0] + wall), (x[1] - wall, x[1]))]
    back = block((x[0] + wall + GAP, x[1] - wall - GAP), (y[1] - 0.008, y[1]), inner_z, finish=finish, bevel=0.001,
                 grain=2)
    return [*plates, *sides, back]


def cabinet(params: dict[str, float], finish_rng: np.random.Generator, _: np.random.Generator) -> Made:
    """Sideboard on legs: doors in the outer bays, drawers in the inner ones and in the second of two."""
    make = materials.lacquer if params["finish"] else materials.frame
    body = make(finish_rng)
    front = body if finish_rng.uniform() < 0.5 else make(finish_rng)
    finishes = {"frame": body, "metal": materials.metal(finish_rng), "front": front}
    x, y = params["width"] / 2, params["depth"] / 2
    body_span = (params["leg_height"] + GAP, params["height"])
    parts = carcass((-x, x), (-y + FRONT + GAP, y), body_span, wall=WALL, finish="frame", bevel=params["bevel"])
    parts += [round_leg((sx * (x - 0.05), sy * (y - 0.06)), (sx * (x - 0.08), sy * (y - 0.08)),
                        (0, params["leg_height"]), (0.022, 0.04), finish="frame") for sx in (-1, 1) for sy in (-1, 1)]
    parts += _bays(params, (-x + 0.002, x - 0.002), (body_span[0] + 0.002, body_span[1] - WALL - 0.003), -y,
                   finish="front")
    return parts, finishes


def _bays(params: dict[str, float], x: Span, z: Span, front: float, *, finish: str) -> list[Part]:
    """Fronts of a cabinet, bay by bay."""
    bays, parts = split(x, int(params["bays"])), []
    style, framed, bevel = int(params["handle"]), bool(params["front"]), params["bevel"]
    for index, bay in enumerate(bays):
        inner = 0 < index < len(bays) - 1 or (len(bays) == 2 and index == 1)
        if inner and params["drawers"]:
            for span in split(z, int(params["drawers"])):
                parts += drawer(bay, span, front, style=style, framed=framed, finish=finish, metal="metal", bevel=bevel)
        else:
            leaves = split(bay, 2 if bay[1] - bay[0] > WIDEST_DOOR else 1)
            for leaf_index, leaf in enumerate(leaves):
                left = leaf_index == 0 if len(leaves) > 1 else index < len(bays) / 2
                parts += door(leaf, z, front, hinge_left=left, style=style, framed=framed, finish=finish, metal="metal",
                              bevel=bevel)
    return parts


def bookshelf(params: dict[str, float], finish_rng: np.random.Generator, book_rng: np.random.Generator) -> Made:
    """Open shelves; every shelf has its own books."""
    finishes = {"frame": materials.frame(finish_rng), "books": materials.books(finish_rng)}
    x, y, board, bevel = params["width"] / 2, params["depth"] / 2, params["board"], params["bevel"]
    plinth = 0.06
    parts = carcass((-x, x), (-y, y), (plinth + GAP, params["height"]), wall=board, finish="frame",
                    bevel=min(bevel, 0.003))
    parts.append(block((-x + 0.004, x - 0.004), (-y + 0.03, y - 0.004), (0, plinth), finish="frame", bevel=bevel,
                       grain=0))
    inner = (-x + board + GAP, x - board - GAP)
    count = int(params["shelves"])
    clear = (params["height"] - plinth - board * (count + 1)) / count
    crowded = params["fill"] * params["width"] * count > 2.5
    for index, shelf_rng in enumerate(book_rng.spawn(count)):
        floor = plinth + GAP + board + index * (clear + board)
        if index:
            parts.append(block(inner, (-y + 0.002, y - 0.008 - GAP), (floor - board, floor), finish="frame",
                               bevel=min(bevel, 0.003), grain=0))
        fill = float(np.clip(params["fill"] + shelf_rng.uniform(-0.15, 0.15), 0, 0.95))
        parts += standing_books(inner, floor, clear, (-y + 0.01, y - 0.01), fill if params["fill"] else 0.0, shelf_rng,
                                bevel=0.0 if crowded else 0.002)
    return parts, finishes


def wardrobe(params: dict[str, float], finish_rng: np.random.Generator, _: np.random.Generator) -> Made:
    """Tall cupboard on a plinth: doors side by side, over a row of drawers if asked for, under a cornice."""
    finishes = {"frame": materials.frame(finish_rng), "metal": materials.metal(finish_rng)}
    x, y, bevel = params["width"] / 2, params["depth"] / 2, params["bevel"]
    low, high = 0.08, params["height"] - 0.03
    parts = carcass((-x, x), (-y + FRONT + GAP, y), (low + GAP, high - GAP), wall=WALL, finish="frame", bevel=bevel)
    parts.append(block((-x + 0.01, x - 0.01), (-y + 0.05, y - 0.01), (0, low), finish="frame", bevel=bevel, grain=0))
    parts.append(block((-x - 0.015, x + 0.015), (-y - 0.015, y), (high, params["height"]), finish="frame",
                       bevel=max(bevel, 0.006), grain=0))
    style, framed, count = int(params["handle"]), bool(params["front"]), int(params["doors"])
    split_at = low + 0.26 if params["drawer"] else low + 0.002
    columns = split((-x + 0.002, x - 0.002), count)
    for index, column in enumerate(columns):
        parts += door(column, (split_at + 0.0015, high - 0.005), -y, hinge_left=index % 2 == 0, style=style,
                      framed=framed, finish="frame", metal="metal", bevel=bevel)
        if params["drawer"]:
            parts += drawer(column, (low + 0.003, split_at - 0.0015), -y, style=style, framed=framed, finish="frame",
                            metal="metal", bevel=bevel)
    return parts, finishes


def nightstand(params: dict[str, float], finish_rng: np.random.Generator, book_rng: np.random.Generator) -> Made:
    """Small chest: drawers over an open shelf where there is room, books on top if asked for."""
    finishes = {"frame": materials.frame(finish_rng), "metal": materials.metal(finish_rng),
                "books": materials.books(finish_rng)}
    x, y, high, bevel = params["width"] / 2, params["depth"] / 2, params["height"], params["bevel"]
    low = 0.14 if not params["base"] else 0.05
    body = (low + GAP, high - 0.022 - GAP)
    front_y = -y + 0.012
    parts = carcass((-x + 0.01, x - 0.01), (front_y + FRONT + GAP, y - 0.005), body, wall=0.016, finish="frame",
                    bevel=bevel)
    parts.append(block((-x, x), (-y, y), (high - 0.022, high), finish="frame", bevel=max(bevel, 0.003), grain=0))
    parts += _nightstand_base(params, x, y, low)
    drawers_low = body[0] + (0.40 * (body[1] - body[0]) if params["drawers"] == 1 else 0.002)
    if params["drawers"] == 1:
        parts.append(block((-x + 0.026 + GAP, x - 0.026 - GAP), (front_y + FRONT + GAP, y - 0.013 - GAP),
                           (drawers_low + 0.002, drawers_low + 0.016), finish="frame", bevel=bevel, grain=0))
    for span in split((drawers_low, body[1] - 0.002), int(params["drawers"])):
        parts += drawer((-x + 0.011, x - 0.011), span, front_y, style=int(params["handle"]), framed=False,
                        finish="frame", metal="metal", bevel=bevel)
    if params["books"]:
        parts += lying_books(int(params["books"]), (0.0, 0.02), high, book_rng, room=1.4 * min(x, y))
    return parts, finishes


def _nightstand_base(params: dict[str, float], x: float, y: float, low: float) -> list[Part]:
    """Four round legs, or a plinth."""
    if params["base"]:
        return [block((-x + 0.02, x - 0.02), (-y + 0.05, y - 0.015), (0, low), finish="frame", bevel=params["bevel"],
                      grain=0)]
    return [round_leg((sx * (x - 0.025), sy * (y - 0.035)), (sx * (x - 0.045), sy * (y - 0.06)), (0, low),
                      (0.018, 0.034), finish="frame") for sx in (-1, 1) for sy in (-1, 1)]
