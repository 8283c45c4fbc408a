"""Time to equal error for the tuple of an embedded example, ours against Blender Cycles, side by side in one run.

Both render the same triangles, textures, lights and camera; each is judged against its own converged reference. relMSE
is over the frame for I_s and I_t, over the object for S'. Cycles gives I_s, D (DiffCol) and R (GlossCol) from one
render, I_t from another, S' (DiffDir + DiffInd) from a third, of the rough mesh.
It needs `bpy` in an environment of its own:

    python benchmarks/against_cycles.py --cache FOLDER         makes the environment in FOLDER/bpy with pip
    python benchmarks/against_cycles.py --bpy-python PYTHON    uses one that has bpy 5

Equal on both sides: two threads (or --threads), box filter of one pixel, longest path, linear colour. Cycles' settings:
scene data kept between renders, no clamping, no glossy blur, caustics on, Open Image Denoise with albedo and normal (in
compositing for S', since Cycles denoises the combined image only); its defaults for the rest: light tree, tabulated
Sobol points, no path guiding, none of which it gains by changing here. The comparison favours Cycles in what cannot be
equal: neither the export of the scene nor its update between renders is counted unless stated, the mask is given to it,
and S' is judged where its materials have a diffuse part; ours counts the building of every scene and all six layers.
"""

import argparse
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import _common as common
import numpy as np
from _equal_error import Reference
from cycles.client import Blender, make_environment
from cycles.contenders import LAYERS, Contender, Cycles, Ours, Setting
from cycles.lamp_check import print_lamp_check
from cycles.verdicts import BEST, Row, draw, print_rows, print_verdicts, summary, verdicts, write_csv

AIM = 5.0
SPECS = common.MINI.parent
LADDERS: Mapping[tuple[str, bool, bool], Sequence[float]] = {
    ("ours", False, False): (16, 64, 256), ("Cycles", False, False): (16, 64, 256),
    ("ours", True, False): (0.32, 0.2, 0.12, 0.08), ("Cycles", True, False): (0.2, 0.1, 0.05, 0.025),
    ("ours", False, True): (4, 16, 64), ("Cycles", False, True): (4, 16, 64),
    ("ours", True, True): (0.64, 0.32, 0.16, 0.08), ("Cycles", True, True): (0.2, 0.1, 0.05, 0.025),
}
"""Knobs of each side, adaptive, denoise; see `contenders.Setting`."""

MODES = ((False, False), (True, False), (False, True), (True, True))
MIN_COLOUR = 0.02
"""Diffuse colour below which Cycles' passes say nothing about S'."""


def references(contender: Contender, spp: int, inside: Mapping[str, np.ndarray]) -> dict[str, Reference]:
    """Each layer's converged image, of two independent halves."""
    halves = [contender.shots(Setting(adaptive=False, denoise=False, knob=spp // 2), seed)[0] for seed in (901, 902)]
    return {layer: Reference.of(halves[0][layer].image, halves[1][layer].image, inside[layer]) for layer in LAYERS}


def measured(contender: Contender, setting: Setting, known: Mapping[str, Reference], example: int,
             repeats: int) -> list[Row]:
    """All layers at one setting."""
    found = [contender.shots(setting, seed) for seed in range(1, repeats + 1)]
    return [Row(example=example, layer=layer, system=contender.name, mode=setting.mode, knob=setting.knob,
                spp=found[0][0][layer].spp, shared=min(shared for _, shared in found),
                seconds=min(shots[layer].seconds for shots, _ in found),
                update=min(shots[layer].update for shots, _ in found),
                error=float(np.mean([known[layer].error(shots[layer].image) for shots, _ in found])))
            for layer in LAYERS]


def inside_of(ours: Ours, cycles: Cycles) -> dict[str, np.ndarray]:
    """Pixels that each layer is judged on. S': those that the clean and the rough object cover whole, where Cycles'
    material has a diffuse part."""
    known = cycles.diffuse_colour().min(axis=-1) > MIN_COLOUR
    frame = np.ones(known.shape, dtype=bool)
    return {"i_s": frame, "i_t": frame, "s_prime": ours.covered() & known}


def race(blender: Blender, example: int, given: argparse.Namespace) -> Iterator[Row]:
    """Every setting of both sides in turn, so that a drifting machine drifts for both."""
    ours = Ours(example, given.size, SPECS)
    with tempfile.TemporaryDirectory() as folder:
        cycles = Cycles(blender, ours.plan(Setting(adaptive=False, denoise=False, knob=4), 1), SPECS, Path(folder))
    inside = inside_of(ours, cycles)
    cycles.crop(inside["s_prime"])
    known = {side.name: references(side, given.reference, inside) for side in (ours, cycles)}
    for layer in LAYERS:
        ratio = known["Cycles"][layer].mean.mean() / known["ours"][layer].mean.mean()
        print(f"example {example}, {layer}: mean of Cycles' reference over ours {ratio:.3f}")
    for adaptive, denoise in MODES:
        ladders = [LADDERS[side.name, adaptive, denoise] for side in (ours, cycles)]
        ours.shots(Setting(adaptive=adaptive, denoise=denoise, knob=ladders[0][0]), 0)
        for knobs in zip(*ladders, strict=True):
            for side, knob in zip((ours, cycles), knobs, strict=True):
                yield from measured(side, Setting(adaptive=adaptive, denoise=denoise, knob=knob), known[side.name],
                                    example, given.repeats)


def arguments() -> argparse.Namespace:
    """What the command line says."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--bpy-python", type=Path, help="Python of an environment that has bpy 5")
    where.add_argument("--cache", type=Path, help="folder to keep such an environment in")
    parser.add_argument("--examples", type=int, nargs="+", default=[0, 20], help="of the mini dataset (default 0 20)")
    parser.add_argument("--size", type=int, default=96, help="pixels along a side (default 96)")
    parser.add_argument("--reference", type=int, default=512, help="spp of the converged images (default 512)")
    parser.add_argument("--repeats", type=int, default=1, help="of every setting, with other noise (default 1)")
    parser.add_argument("--threads", type=int, default=2, help="of both sides (default 2)")
    parser.add_argument("--csv", type=Path, help="also write all measurements here")
    parser.add_argument("--figure", type=Path, help="also draw them here")
    parser.add_argument("--lamps", action="store_true", help="only compare what every kind of lamp sends")
    return parser.parse_args()


def report(rows: Sequence[Row], given: argparse.Namespace) -> float:
    """Print everything; the whole tuple's ratio, both sides at their best."""
    found = verdicts(rows)
    print_rows(rows)
    print_verdicts(found)
    ratios = summary(found)
    print("\nCycles' time over ours at equal relMSE, geometric mean over examples:")
    for (mode, layer), ratio in ratios.items():
        print(f"{mode:19} {layer:8} {ratio:5.1f}x" + (f" (aim {AIM:g}x)" if layer == "tuple" else ""))
    if given.csv:
        write_csv(given.csv, rows)
    if given.figure:
        draw(given.figure, rows)
    return ratios[BEST, "tuple"]


def main() -> int:
    """Print the figures; exit code 1 where the aim is missed."""
    given = arguments()
    if not given.bpy_python and not given.cache:
        print("not run: give --bpy-python PYTHON of an environment with bpy, or --cache FOLDER to make one in")
        return 0
    python = given.bpy_python or make_environment(given.cache / "bpy")
    common.start(given.threads)
    with Blender(python, given.threads) as blender:
        print(f"Blender {blender.version}, {given.threads} threads each, {given.size}x{given.size}")
        if given.lamps:
            return print_lamp_check(blender, given.examples[0], given.size)
        rows = [row for example in given.examples for row in race(blender, example, given)]
    return 0 if report(rows, given) >= AIM else 1


if __name__ == "__main__":
    sys.exit(main())
