"""All layers of one geometry under one light in one pass, and the whole tuple, against Mitsuba's own `path`.

Equal spp, pixels, depth and scene, embedded room, 256x256, in seconds of CPU time, which other work on the machine
disturbs less than it does those of the clock. Bounds: 1.10 for one pass of all layers, by camera paths; 0.7 for the
tuple against three full-frame renders (source light, target light, and the rough mesh under it), scene loading included
on both sides. Passes for the image alone and for shading alone, as the tuple takes them, are printed, too.
Depth 8 and roulette from 5, Mitsuba's own default; `path` with its default sampler, the fastest. The bound on the tuple
holds for the paper's six layers on the object and with i_s and i_t on the frame.
"""

import gc
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from time import process_time

import _common as common
import mitsuba as mi
import numpy as np

from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.rendering import passes
from dataset_builder.rendering.examples import render_view
from dataset_builder.rendering.scene.open_scene import body_of, open_scene, sensor_of
from dataset_builder.rendering.scene.triangle_soup import clean, merge, rough_twin, surroundings

SPP, SIZE, EXAMPLES = 64, 256, (0, 3, 20)
ASKED = ("render.transport=camera", "render.max_depth=8", "render.rr_depth=5", f"image.width={SIZE}",
         f"image.height={SIZE}", f"render.spp={SPP}")
PAPER = "layers={i_s: object, d: object, r: object, i_t: object, s_prime: object, mask: object}"
ONE_PASS, TUPLE = 1.10, 0.7
PARTS = {"all layers": frozenset(passes.RADIANCE), "the image alone": frozenset({"image"}),
         "shading alone": frozenset({"shading"})}
SPECS = common.MINI.parent


def path_render(plan: ExamplePlan) -> Callable[[object], np.ndarray]:
    """Full-frame render of a staged scene with Mitsuba's C++ path integrator."""
    sensor = sensor_of(plan.camera, SIZE, SIZE)
    depth = plan.effects.of("target").max_depth
    path = mi.load_dict({"type": "path", "max_depth": depth, "rr_depth": plan.render.rr_depth})
    return lambda opened: np.array(mi.render(opened.scene, integrator=path, sensor=sensor, spp=SPP, seed=1))


def one_pass(plan: ExamplePlan) -> list[float]:
    """Seconds of our pass for each of PARTS and of `path`, the scene being there."""
    body = body_of(merge([clean(plan.target, SPECS), surroundings(plan, SPECS)]),
                   features=frozenset(plan.effects.features))
    depth = plan.effects.of("target").max_depth
    view, pixels = passes.ViewSensor(camera=plan.camera, render=plan.render), np.arange(SIZE * SIZE)
    render = path_render(plan)
    with open_scene(body, plan.target_light) as opened:
        ours = [partial(passes.radiance, view, opened, pixels, max_depth=depth, spp=SPP, seed=1, wanted=wanted)
                for wanted in PARTS.values()]
        return common.best([*ours, lambda: render(opened)], clock=process_time)


def three_renders(plan: ExamplePlan, root: Path) -> None:
    """Source light, target light, and the rough mesh under the target light, each on the full frame."""
    render, target, room = path_render(plan), clean(plan.target, root), surroundings(plan, root)
    opened = room.without(plan.source_light.open)
    rough = rough_twin(plan.target, plan.rough, root).soup
    for parts, light in (([target, opened], plan.source_light), ([target, room], plan.target_light),
                         ([rough, room], plan.target_light)):
        with open_scene(body_of(merge(parts), features=frozenset(plan.effects.features)), light) as opened:
            render(opened)
        gc.collect()


def whole_tuple(plan: ExamplePlan) -> None:
    """Every layer of one example."""
    list(render_view([plan], SPECS))


def ratio_of(times: Sequence[Sequence[float]]) -> float:
    """Geometric mean of ours over theirs."""
    return float(np.exp(np.mean([np.log(ours / theirs) for ours, theirs in times])))


def main() -> int:
    """Print the ratios; exit code 1 where a bound is broken."""
    common.start()
    mini, paper = ([common.plan(index, *ASKED, *more) for index in EXAMPLES] for more in ((), (PAPER,)))
    times = [one_pass(plan) for plan in mini]
    ratios = [ratio_of([(found[place], found[-1]) for found in times]) for place in range(len(PARTS))]
    for name, ratio in zip(PARTS, ratios, strict=True):
        bound = f" (bound {ONE_PASS}x)" if name == "all layers" else ""
        print(f"one pass, {name}, over path alone: {ratio:.2f}x{bound}")
    tuples = {}
    for name, plans in (("object", paper), ("i_s and i_t on the frame", mini)):
        works = [(partial(whole_tuple, plan), partial(three_renders, plan, SPECS)) for plan in plans]
        tuples[name] = ratio_of([common.best(pair, 3, process_time) for pair in works])
        print(f"whole tuple, {name}, over three path renders: {tuples[name]:.2f}x (bound {TUPLE}x)")
    return 0 if ratios[0] <= ONE_PASS and max(tuples.values()) <= TUPLE else 1


if __name__ == "__main__":
    sys.exit(main())
