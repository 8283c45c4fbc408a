"""How often 95% intervals of pixels hold a converged mean: outlines of lamps, bright tails, caustics, elsewhere.

    python -m benchmarks.coverage                       made scenes, I and S, 16 and 64 spp and a goal
    python -m benchmarks.coverage --examples 22t 36r    passes of the mini dataset, too (--spec FILE: of another)
    python -m benchmarks.coverage --size 24 --runs 2    coarser, for a look

`now / without`: as the product has it, and without what outlines add (`sampling.outlines`). `error`: what records state
as `relative_error`, likewise, and `true`, by the reference. Below each line are the 95% intervals of its coverages
`now`: pixels of a run share errors, so they are wider than those of as many independent ones. Exit code 1 where a group
of all scenes is held in less than 92% or more than 98%, or where a cell is told to be: by intervals that all hold their
coverages in 99 of 100 tables.
"""

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from unittest import mock

import drjit as dr
import mitsuba as mi
import numpy as np

from benchmarks import _common as common
from benchmarks.transports.interval_coverage import LEAST, MOST, confidence
from benchmarks.transports.lit_pass import LETTERS, passes_of
from dataset_builder.assets.asset import Material
from dataset_builder.label.scene_plan import LightPlan
from dataset_builder.rendering.passes import RADIANCE_CHANNELS, primary_ray, radiance_sampler
from dataset_builder.rendering.sampling import pixel_noise
from dataset_builder.rendering.sampling.adaptive import Goal, Sample, Sampled, more_samples, refine
from dataset_builder.rendering.sampling.estimate import Samplers
from dataset_builder.rendering.sampling.moments import Estimate, pooled, relative, root_mean_square
from dataset_builder.rendering.scene.open_scene import OpenScene, body_of, open_scene
from dataset_builder.rendering.scene.triangle_soup import Soup
from dataset_builder.rendering.view_sensor import ViewSensor
from tests.rendering.transport.joined_bench import room
from tests.small_scenes import ball, camera, light, lit_by, matte, render_plan

FAILURES = 0.01
"""Share of tables of sound cells in which any is told to be outside the bounds."""
GROUPS = ("outlines", "bright", "caustics", "rest")
DARK = matte((0.02, 0.02, 0.02))
STEEL = Material(name="steel", base_color=(0.9, 0.8, 0.6), metallic=1.0, roughness=0.15)
BEHIND = {"position": (0.1, 0.9, 0.55)}
LAMPS = {"ball before a wall": light("sphere", (9.0, 8.0, 7.0), size=0.5, **BEHIND),
         "square before a wall": light("area", (9.0, 8.0, 7.0), direction=(0.3, -1, -0.2), size=0.9, **BEHIND),
         "square from behind": light("area", (9.0, 8.0, 7.0), direction=(0, 1, 0), size=0.9, **BEHIND),
         "ball at a wall": light("sphere", (9.0, 8.0, 7.0), size=0.2, position=(0.1, 1.79, 0.3)),
         "tube": light("cylinder", (90.0, 80.0, 70.0), direction=(1, 0, 0.3), size=0.02, length=1.2, **BEHIND)}
OVERHEAD = light("area", (30.0, 28.0, 25.0), position=(0.9, 0.2, 1.7), size=0.3)
DEPTH, GAIN = 6, 1.1


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """A scene that is open."""

    name: str
    view: ViewSensor
    opened: OpenScene
    sample: Sample
    pixels: np.ndarray
    layers: tuple[str, ...]
    caustics: np.ndarray
    """(P,) of truth: where a body that gathers light makes it brighter."""


def made(size: int, reference: int) -> Iterator[Case]:
    """Lamps before a dark wall, and a steel ball under a small lamp; caustics are where the floor would be darker
    by a tenth without it."""
    view, pixels = ViewSensor(camera=camera((0, -1.9, 0.6), (0, 0, -0.2), fov=75), render=render_plan(size)), np.arange(
        size * size)

    def case(name: str, soup: Soup, lamp: LightPlan, caustics: np.ndarray) -> Iterator[Case]:
        with open_scene(body_of(soup), lit_by(lamp)) as opened:
            transport = "joined" if len(opened.body.casters) else "camera"
            yield Case(name=name, view=view, opened=opened, pixels=pixels, layers=("image", "shading"),
                       sample=radiance_sampler(view, opened, DEPTH, transport, transport == "joined"),
                       caustics=caustics)

    for name, lamp in LAMPS.items():
        yield from case(name, room(wall=DARK), lamp, np.zeros(len(pixels), dtype=bool))
    steel, shading = ball(STEEL, (0.0, 0.3, -0.4), 0.5), RADIANCE_CHANNELS["shading"]
    lit = []
    for things in ((steel,), ()):
        for found in case("", room(*things), OVERHEAD, np.zeros(len(pixels), dtype=bool)):
            lit.append(found.sample(pixels, reference, 4, 99).mean[:, shading].mean(axis=1))
    yield from case("steel ball", room(steel), OVERHEAD, lit[0] > GAIN * lit[1])


def planned(given: argparse.Namespace) -> Iterator[Case]:
    """Passes of a spec."""
    size = f"image={{width: {given.size}, height: {given.size}}}"
    for found in passes_of(given.spec, given.examples, (size,)):
        with found.opened() as opened:
            sample = radiance_sampler(opened.view, opened.scene, opened.max_depth, found.planned, opened.caustics)
            layers = ("image", "shading") if found.letter == "t" else (LETTERS[found.letter][1],)
            yield Case(name=found.name, view=opened.view, opened=opened.scene, sample=sample, pixels=opened.pixels,
                       layers=layers, caustics=np.zeros(len(opened.pixels), dtype=bool))


def crossed(case: Case) -> np.ndarray:
    """(P,) of truth: pixels that some of 1024 rays find a lamp in, and some do not."""
    scene, sensor = case.opened.scene, case.view.sensor()

    def integrand(_: Samplers, position: mi.Vector2f) -> list[mi.Float]:
        met = scene.ray_intersect(primary_ray(sensor, position))
        return [dr.select(met.is_valid() & (met.emitter(scene) != None), mi.Float(1), 0)]  # noqa: E711

    share = case.view.estimate(integrand, case.pixels, 1024, 1, 7).mean[:, 0]
    return (share > 0) & (share < 1)


def groups(case: Case, truth: Estimate, channels: slice) -> dict[str, np.ndarray]:
    """(P,) of truth each, no pixel in two: outlines, caustics, the brightest twentieth of the others, the rest; pixels
    without noise are in none."""
    value, edge = truth.mean[:, channels].mean(axis=1), crossed(case)
    noisy = (truth.error[:, channels] > 0).any(axis=1) & ~edge
    found = {"outlines": edge, "caustics": noisy & case.caustics}
    found["bright"] = noisy & ~case.caustics & (value > np.quantile(value[noisy], 0.95))
    return found | {"rest": noisy & ~case.caustics & ~found["bright"]}


def sampled(case: Case, layer: str, spp: int, error: float, seed: int) -> Sampled:
    """One run, at a fixed spp or with a goal for the layer."""
    batches = case.view.render.batches
    if not error:
        return more_samples(case.sample, case.pixels, None, spp=spp, part=0, batches=batches, seed=seed)
    goal = Goal(layer=layer, channels=RADIANCE_CHANNELS[layer], inside=np.ones(len(case.pixels), dtype=bool),
                error=error, seconds=0, cap=1024)
    return refine(case.sample, case.pixels, case.view.render.width, first=16, batches=batches, goals=[goal], seed=seed)


def judged(case: Case, run: Sampled, with_outlines: bool) -> Estimate:
    """The run's means and errors."""
    with ExitStack() as stack:
        if not with_outlines:
            nothing = mock.Mock(side_effect=lambda found, *_: np.zeros_like(found.mean))
            stack.enter_context(mock.patch.object(pixel_noise, "outline_variance", nothing))
        return run.estimate(case.pixels, case.view.render.width)


def compared(case: Case, given: argparse.Namespace, total: dict[tuple[str, bool], list[np.ndarray]],
             cells: dict[str, list[np.ndarray]]) -> None:
    """Print a line for each layer and setting of a case, and add to what is held of all, and in which cell."""
    truth = pooled([case.sample(case.pixels, 1024, 4, 9900 + k) for k in range(max(1, given.reference // 1024))])
    for layer in case.layers:
        channels = RADIANCE_CHANNELS[layer]
        inside = groups(case, truth, channels)
        for spp, error in [(spp, 0.0) for spp in given.spp] + [(0, given.goal)] * bool(given.goal):
            held, errors, true = defaultdict(list), defaultdict(list), []
            for run in (sampled(case, layer, spp, error, 1000 + seed) for seed in range(given.runs)):
                for now in (True, False):
                    found = judged(case, run, now)
                    off = found.mean - truth.mean
                    right = (np.abs(off) <= np.hypot(found.interval(), truth.interval()))[:, channels]
                    errors[now].append(root_mean_square(relative(found.mean[:, channels], found.error[:, channels])))
                    for group in GROUPS:
                        held[group, now].append(right[inside[group]])
                true.append(root_mean_square(relative(truth.mean[:, channels], off[:, channels])))
            setting = f"{case.name:24} {layer:8} {f'{spp} spp' if spp else f'goal {error:g}':9} "
            for key, parts in held.items():
                total[key].extend(parts)
            cells.update({setting + group: held[group, True] for group in GROUPS if inside[group].any()})
            print(setting
                  + " ".join(f"{share(held[group, True])} / {share(held[group, False])}" for group in GROUPS)
                  + f"   {np.mean(errors[True]):.3f} / {np.mean(errors[False]):.3f}   {np.mean(true):.3f}")
            print(" " * len(setting) + " ".join(f"{spanned(held[group, True]):13}" for group in GROUPS), flush=True)


def share(held: list[np.ndarray]) -> str:
    """Per cent, or a dash where there are no such pixels."""
    return f"{100 * np.mean(np.concatenate(held)):5.1f}" if sum(map(len, held)) else "    -"


def spanned(held: list[np.ndarray]) -> str:
    """Interval in per cent."""
    if not sum(map(len, held)):
        return ""
    least, most = confidence(held)
    return f"{100 * least:.0f} to {100 * most:.0f}"


def told_apart(cells: dict[str, list[np.ndarray]]) -> list[str]:
    """Cells whose coverages are below LEAST or above MOST beyond doubt."""
    found = []
    for name, held in cells.items():
        least, most = confidence(held, 1 - (1 - FAILURES) ** (1 / len(cells)))
        if most < LEAST or least > MOST:
            found.append(f"{name}: {share(held).strip()}%, {100 * least:.1f} to {100 * most:.1f}")
    return found


def main() -> int:
    """The table; exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spp", type=int, nargs="+", default=[16, 64])
    parser.add_argument("--goal", type=float, default=0.2)
    parser.add_argument("--size", type=int, default=32)
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--reference", type=int, default=4096)
    parser.add_argument("--spec", type=type(common.MINI), default=common.MINI)
    parser.add_argument("--examples", nargs="*", default=[])
    given = parser.parse_args()
    common.start()
    total: dict[tuple[str, bool], list[np.ndarray]] = defaultdict(list)
    cells: dict[str, list[np.ndarray]] = {}
    print(f"{'now / without':24} {'':18} " + " ".join(f"{group:13}" for group in GROUPS) + "   error           true")
    for source in (made(given.size, given.reference), planned(given)):
        for case in source:
            compared(case, given, total, cells)
    print(f"{'all':24} {'':18} "
          + " ".join(f"{share(total[group, True])} / {share(total[group, False])}" for group in GROUPS))
    means = [np.mean(np.concatenate(total[group, True])) for group in GROUPS if sum(map(len, total[group, True]))]
    outside = told_apart(cells)
    print(*(f"outside {LEAST:.0%} to {MOST:.0%}: {cell}" for cell in outside), sep="\n")
    return 0 if all(LEAST <= mean <= MOST for mean in means) and not outside else 1


if __name__ == "__main__":
    sys.exit(main())
