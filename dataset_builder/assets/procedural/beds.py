"""Beds: frame, headboard, mattress, pillows and a blanket that hangs over the sides."""

import numpy as np

from dataset_builder.assets.procedural import materials
from dataset_builder.assets.procedural.fittings import square_leg
from dataset_builder.assets.procedural.parts import GAP, Made, Part, block, mirrored, moved, padding
from dataset_builder.assets.procedural.soft import draped, pillow
from dataset_builder.assets.procedural.textures import smooth_noise

MATTRESS, RAIL = 0.20, 0.025
BLANKET = 0.018
PILLOW_END = 0.50
"""From the head of the mattress to the lower edge of the pillows, metres; the blanket ends before it."""
DROP = 0.15
"""How far the blanket hangs down the sides, metres."""


def bed(params: dict[str, float], finish_rng: np.random.Generator, cloth_rng: np.random.Generator) -> Made:
    """Bed with its foot to the front; two pillows where it is wide enough."""
    finishes = {"frame": materials.frame(finish_rng), "sheet": materials.linen(finish_rng, "ivory"),
                "blanket": materials.one_of(finish_rng, materials.linen, materials.velvet),
                "cover": materials.cover(finish_rng)}
    return [*_frame(params), *_head(params), *_bedding(params, cloth_rng)], finishes


def _frame(params: dict[str, float]) -> list[Part]:
    """Side rails, foot rail, slatted base as one board, feet."""
    x, y, bevel = params["width"] / 2 + 0.01, params["length"] / 2 + 0.01, params["bevel"]
    deck = params["height"] - MATTRESS
    rail = (deck - 0.10, deck + 0.035)
    side = block((x, x + RAIL), (-y, y), rail, finish="frame", bevel=bevel)
    foot = block((-x - RAIL, x + RAIL), (-y - RAIL - GAP, -y - GAP), rail, finish="frame", bevel=bevel)
    base = block((-x + GAP, x - GAP), (-y + GAP, y - GAP), (deck - 0.03, deck - GAP), finish="frame", bevel=bevel,
                 grain=0)
    legs = [square_leg((x - 0.03, sy * (y - 0.06)), (x - 0.03, sy * (y - 0.06)), (0, deck - 0.03 - GAP), (0.04, 0.055),
                       finish="frame", bevel=bevel) for sy in (-1, 1)]
    return [*mirrored([side, *legs]), foot, base]


def _head(params: dict[str, float]) -> list[Part]:
    """Headboard behind the rails: a board, slats between posts, or a padded panel."""
    x, y = params["width"] / 2 + 0.035, params["length"] / 2 + 0.011
    bevel, high = params["bevel"], params["head_height"]
    deep, low = (y, y + 0.035), params["height"] - MATTRESS - 0.08
    if params["head"] == 1:
        post = block((x - 0.045, x), deep, (0, high), finish="frame", bevel=bevel)
        inner = x - 0.045 - GAP
        rails = [block((-inner, inner), (y + 0.006, y + 0.03), z, finish="frame", bevel=bevel)
                 for z in ((low, low + 0.08), (high - 0.09, high - 0.01))]
        count = max(int(params["width"] / 0.13), 5)
        places = np.linspace(-inner, inner, count + 2)[1:-1]
        slats = [block((at - 0.016, at + 0.016), (y + 0.010, y + 0.026), (low + 0.08 + GAP, high - 0.09 - GAP),
                       finish="frame", bevel=bevel) for at in places]
        return [*mirrored([post]), *rails, *slats]
    board = block((-x, x), deep if not params["head"] else (y + 0.02, y + 0.04),
                  (low - 0.05 if params["head"] else 0.0, high), finish="frame", bevel=max(bevel, 0.004), grain=0)
    if not params["head"]:
        return [board]
    count = 2 if params["width"] < 1.3 else 4
    edges = np.linspace(-x + 0.006, x - 0.006, count + 1)
    pads = [padding((edges[k] + 0.001, edges[k + 1] - 0.001), (y - 0.006, y + 0.02 - GAP),
                    (params["height"] - 0.12, high - 0.008),
                    finish="cover", radius=0.012, crown=0.2, side="-y", arc_steps=2) for k in range(count)]
    legs = mirrored([block((x - 0.08, x - 0.02), (y + 0.02, y + 0.04), (0, low - 0.05 - GAP), finish="frame",
                           bevel=bevel)])
    return [board, *pads, *legs]


def _bedding(params: dict[str, float], rng: np.random.Generator) -> list[Part]:
    """Mattress between the rails, pillows at the head, blanket over the foot end."""
    x, y, top = params["width"] / 2, params["length"] / 2 - 0.01, params["height"]
    mattress = padding((-x, x), (-y, y), (top - MATTRESS + GAP, top), finish="sheet", radius=0.055)
    count = 1 if params["width"] < 1.25 else 2
    size = (min(0.74, 2 * x / count - 0.06), 0.44, 0.16)
    pillows = []
    for index in range(count):
        flat = moved(Part(mesh=pillow(size), finish="sheet"), (0, 0, 0.082 + top))
        at = 0.0 if count == 1 else (index - 0.5) * x
        pillows.append(moved(flat, (at, params["length"] / 2 - PILLOW_END + size[1] / 2, 0)))
    return [mattress, *pillows, *_blanket(params, rng)]


def _blanket(params: dict[str, float], rng: np.random.Generator) -> list[Part]:
    """Blanket with soft folds from the foot end up, and its turned-down upper edge, a second layer of sheet."""
    length = min(params["cover"] * params["length"], params["length"] - PILLOW_END - 0.045)
    foot = -params["length"] / 2 + 0.012
    steps = 12
    path = _over_mattress(params["width"] / 2, params["height"], 0.004)
    main = Part(mesh=draped(path, thickness=BLANKET, length=length, steps=steps, ripple=_folds(rng, len(path), steps)),
                finish="blanket")
    outer = _over_mattress(params["width"] / 2, params["height"], 0.004 + BLANKET + 0.015)
    turn = draped(outer, thickness=0.010, length=0.26, steps=2, ripple=np.zeros((len(outer), 3)))
    edge = Part(mesh=turn, finish="sheet")
    return [moved(main, (0, foot + length / 2, 0)), moved(edge, (0, foot + length - 0.12, 0))]


def _over_mattress(half: float, top: float, clear: float) -> np.ndarray:
    """(K, 2) path in x and z, `clear` metres outside a rounded mattress: up its left side, over, down its right."""
    radius = 0.055
    arc = np.linspace(0, np.pi / 2, 7)
    corner = np.stack([half - radius + (radius + clear) * np.sin(arc), top - radius + (radius + clear) * np.cos(arc)],
                      axis=-1)
    low = np.array([(half + clear, top - z) for z in np.linspace(radius, DROP, 4)[1:]])
    right = np.concatenate([corner, low])
    across = np.linspace(half - radius, -(half - radius), 8)[1:-1]
    over = np.stack([across, np.full(len(across), top + clear)], axis=-1)
    return np.concatenate([(right * (-1, 1))[::-1], over[::-1], right])


def _folds(rng: np.random.Generator, rows: int, steps: int) -> np.ndarray:
    """(rows, steps + 1) smooth heights in [0, 0.012] metres."""
    field = smooth_noise(rng, 48, u_scale=0.10, v_scale=0.10)[:rows, : steps + 1]
    return 0.012 * np.clip(0.5 + 0.25 * field, 0, 1)
