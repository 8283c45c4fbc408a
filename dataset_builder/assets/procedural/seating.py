"""Chairs, stools and benches: wooden frames with a bare or a padded seat."""

import numpy as np

from dataset_builder.assets.procedural import materials
from dataset_builder.assets.procedural.fittings import round_leg, square_leg
from dataset_builder.assets.procedural.parts import GAP, Made, Part, block, leaning, mirrored, moved, padding, rod
from dataset_builder.assets.procedural.round_solids import chamfered_square, disc, post, turned
from dataset_builder.geometry.mesh import TriangleMesh

SEAT_BOARD = 0.022


def chair(params: dict[str, float], finish_rng: np.random.Generator, _: np.random.Generator) -> Made:
    """Dining chair: square legs, the hind ones rising into the back; aprons below the seat."""
    finishes = {"frame": materials.frame(finish_rng), "cover": materials.cover(finish_rng)}
    parts = [*_chair_legs(params), *_chair_seat(params), *_chair_back(params)]
    return leaning(parts, above=params["seat_height"], degrees=params["recline"]), finishes


def _chair_legs(params: dict[str, float]) -> list[Part]:
    """Front legs, hind legs that go up to the top of the back, aprons and side stretchers between them."""
    leg, bevel, seat = params["leg"], params["bevel"], params["seat_height"]
    x, y = params["width"] / 2 - leg / 2, params["depth"] / 2
    under = seat - SEAT_BOARD - GAP
    front = square_leg((x, -y + leg / 2), (x, -y + leg / 2), (0, under), (0.72 * leg, leg), finish="frame", bevel=bevel)
    path = np.array([(x, y + 0.02, 0), (x, y, seat), (x, y, params["back_height"])])
    hind = Part(mesh=post(chamfered_square(2 * bevel / leg), path, np.array([0.8, 1, 1]) * leg / 2, bevel=bevel),
                finish="frame")
    apron = (seat - SEAT_BOARD - 0.065, under)
    inner = x - leg / 2 - GAP
    low = 0.20
    side = block((x - 0.4 * leg, x + 0.4 * leg), (-y + leg + GAP, y - leg / 2 - GAP), apron, finish="frame",
                 bevel=bevel)
    stretcher = block((x - 0.25 * leg, x + 0.25 * leg), (-y + leg + GAP, y - leg / 2 - GAP), (low, low + 0.03),
                      finish="frame", bevel=bevel)
    ahead = block((-inner, inner), (-y + 0.1 * leg, -y + 0.9 * leg), apron, finish="frame", bevel=bevel)
    behind = block((-inner, inner), (y - 0.4 * leg, y + 0.4 * leg), apron, finish="frame", bevel=bevel)
    return [*mirrored([front, hind, side, stretcher]), ahead, behind]


def _chair_seat(params: dict[str, float]) -> list[Part]:
    """Seat board in front of the hind legs, with or without a cushion."""
    leg, bevel, seat = params["leg"], params["bevel"], params["seat_height"]
    x, back = params["width"] / 2 + 0.008, params["depth"] / 2 - leg / 2 - 2 * GAP
    front = -params["depth"] / 2 - 0.012
    board = block((-x, x), (front, back), (seat - SEAT_BOARD, seat), finish="frame", bevel=max(bevel, 0.004), grain=1)
    if not params["seat"]:
        return [board]
    pad = padding((-x + 0.015, x - 0.015), (front + 0.015, back - 0.005), (seat + GAP, seat + 0.045), finish="cover",
                  radius=0.02, crown=0.25, inner_steps=4)
    return [board, pad]


def _chair_back(params: dict[str, float]) -> list[Part]:
    """What stands between the hind legs above the seat; upright here, reclined by the caller."""
    leg, bevel, style = params["leg"], params["bevel"], params["back"]
    half, y = params["width"] / 2 - leg - GAP, params["depth"] / 2
    low, high = params["seat_height"] + 0.09, params["back_height"] - 0.006
    flat = (y - 0.28 * leg, y + 0.28 * leg)
    if style == 2:
        rails = [block((-half, half), flat, (high - 0.035, high), finish="frame", bevel=bevel)]
        pad = padding((-half + 0.004, half - 0.004), (y - 0.026, y + 0.012), (low, high - 0.035 - GAP),
                      finish="cover", radius=0.016, crown=0.15, side="-y", inner_steps=3)
        return [*rails, pad]
    if style == 3:
        return [block((-half, half), flat, (low, high), finish="frame", bevel=bevel)]
    if style == 1:
        pitch = (high - low) / 3
        return [block((-half, half), flat, (low + k * pitch, low + k * pitch + 0.55 * pitch), finish="frame",
                      bevel=bevel)
                for k in range(3)] + [block((-half, half), flat, (high - 0.3 * pitch, high), finish="frame",
                                            bevel=bevel)]
    rails = [block((-half, half), flat, z, finish="frame", bevel=bevel)
             for z in ((low, low + 0.03), (high - 0.06, high))]
    places = np.linspace(-half, half, 7)[1:-1]
    slats = [block((at - 0.012, at + 0.012), (y - 0.007, y + 0.007), (low + 0.03 + GAP, high - 0.06 - GAP),
                   finish="frame", bevel=bevel) for at in places]
    return rails + slats


def stool(params: dict[str, float], finish_rng: np.random.Generator, _: np.random.Generator) -> Made:
    """Stool: round splayed legs joined by bars, a round or square seat, bare or padded."""
    finishes = {"frame": materials.frame(finish_rng), "cover": materials.cover(finish_rng),
                "metal": materials.metal(finish_rng)}
    return [*_stool_legs(params), *_stool_seat(params)], finishes


def _stool_legs(params: dict[str, float]) -> list[Part]:
    """Four legs and a ring of four bars at a third of the height."""
    leg, splay = params["leg"], params["splay"]
    top = params["width"] * (0.30 if not params["shape"] else 0.38) - (0 if not params["shape"] else leg / 4)
    under = params["height"] - _stool_seat_thickness(params) - GAP
    legs = [round_leg((sx * (top + splay), sy * (top + splay)), (sx * top, sy * top), (0, under), (0.7 * leg, leg),
                      finish="frame") for sx in (-1, 1) for sy in (-1, 1)]
    share = 0.36
    spread, reach = top + splay * (1 - share), 0.5 * leg * (0.7 + 0.3 * share) + 0.0035
    bars = []
    for quarter in range(4):
        angle = quarter * np.pi / 2
        ahead, aside = np.array([np.cos(angle), np.sin(angle), 0]), np.array([-np.sin(angle), np.cos(angle), 0])
        level = np.array([0, 0, share * under])
        bars.append(rod(spread * aside - (spread - reach) * ahead + level,
                        spread * aside + (spread - reach) * ahead + level, 0.008, finish="metal"))
    return [*legs, *bars]


def _stool_seat(params: dict[str, float]) -> list[Part]:
    """Seat board, under a cushion where it has one; either way the top is at the height asked for."""
    half, high, bevel = params["width"] / 2, params["height"], params["bevel"]
    low = high - _stool_seat_thickness(params)
    top = low + (0.018 if params["seat"] else 0.03)
    edge = bevel if params["seat"] else max(bevel, 0.005)
    if params["shape"]:
        board = block((-half, half), (-half, half), (low, top), finish="frame", bevel=edge)
        return [board] if not params["seat"] else [
            board, padding((-half, half), (-half, half), (top + GAP, high), finish="cover", radius=0.025, crown=0.2)]
    board = moved(Part(mesh=disc(half, top - low, bevel=edge), finish="frame"), (0, 0, low))
    if not params["seat"]:
        return [board]
    return [board, moved(Part(mesh=round_pad(half, high - top - GAP), finish="cover"), (0, 0, top + GAP))]


def _stool_seat_thickness(params: dict[str, float]) -> float:
    return 0.07 if params["seat"] else 0.03


def round_pad(radius: float, height: float, *, crown: float = 0.25) -> TriangleMesh:
    """Round cushion on z in [0, height] with a rounded rim and a swollen top."""
    arc = np.linspace(-np.pi / 2, np.pi / 2, 13)
    rim = height * (1 - crown) / 2
    side = np.stack([radius - rim + rim * np.cos(arc), rim + rim * np.sin(arc)], axis=-1)
    share = np.linspace(1, 0.08, 6)[1:]
    dome = np.stack([(radius - rim) * share, 2 * rim + crown * height * (1 - share**2)], axis=-1)
    return turned(np.concatenate([side, dome]))


def bench(params: dict[str, float], finish_rng: np.random.Generator, _: np.random.Generator) -> Made:
    """Bench: four square legs, rails, and slats or a padded seat."""
    finishes = {"frame": materials.frame(finish_rng), "cover": materials.cover(finish_rng)}
    leg, bevel, top = params["leg"], params["bevel"], params["height"]
    x, y = params["width"] / 2 - 0.06 - leg / 2, params["depth"] / 2 - 0.015 - leg / 2
    seat_low = top - (0.024 if not params["seat"] else 0.09)
    under = seat_low - GAP
    legs = [square_leg((sx * (x + 0.02), sy * y), (sx * x, sy * y), (0, under), (0.75 * leg, leg), finish="frame",
                       bevel=bevel) for sx in (-1, 1) for sy in (-1, 1)]
    rail = (under - 0.06, under)
    long_rails = [block((-x + leg / 2 + 0.003, x - leg / 2 - 0.003), (sy * y - 0.3 * leg, sy * y + 0.3 * leg), rail,
                        finish="frame", bevel=bevel) for sy in (-1, 1)]
    short_rails = [block((sx * x - 0.3 * leg, sx * x + 0.3 * leg), (-y + leg / 2 + GAP, y - leg / 2 - GAP), rail,
                         finish="frame", bevel=bevel) for sx in (-1, 1)]
    return [*legs, *long_rails, *short_rails, *_bench_seat(params, seat_low)], finishes


def _bench_seat(params: dict[str, float], low: float) -> list[Part]:
    """Slats along the bench, or a board with a cushion."""
    x, y, top = params["width"] / 2, params["depth"] / 2, params["height"]
    if not params["seat"]:
        pitch = (2 * y + 0.012) / 5
        return [block((-x, x), (-y + k * pitch, -y + (k + 1) * pitch - 0.012), (low, top), finish="frame",
                      bevel=max(params["bevel"], 0.003)) for k in range(5)]
    board = block((-x, x), (-y, y), (low, low + 0.02), finish="frame", bevel=params["bevel"])
    return [board, padding((-x + 0.004, x - 0.004), (-y + 0.004, y - 0.004), (low + 0.02 + GAP, top), finish="cover",
                           radius=0.03, crown=0.18, inner_steps=5)]
