"""All layers of one geometry under one light in one pass, and the whole tuple, against Mitsuba's own `path`.

Equal spp, pixels, depth and scene, embedded room, 256x256. Bounds: 1.15 for one pass, 0.7 for the tuple against three
full-frame renders (source light, target light, and the rough mesh under it), scene loading included on both sides.
Depth 8 and roulette from 5, Mitsuba's own default; `path` with its default sampler, the fastest. The bound on the tuple
is for the paper's six layers on the object; with i_s and i_t on the frame it is printed, too.
"""

import gc
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import _common as common
import mitsuba as mi
import numpy as np

from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.rendering import passes
from dataset_builder.rendering.examples import render_view
from dataset_builder.rendering.scene.open_scene import body_of, open_scene, sensor_of
from dataset_builder.rendering.scene.triangle_soup import clean, merge, rough_twin, surroundings

SPP, SIZE, EXAMPLES = 64, 256, (0, 3, 20)
ASKED = ("render.max_depth=8", "render.rr_depth=5", f"image.width={SIZE}", f"image.height={SIZE}", f"render.spp={SPP}")
PAPER = "layers={i_s: object, d: object, r: object, i_t: object, s_prime: object, mask: object}"
ONE_PASS, TUPLE = 1.15, 0.7
SPECS = common.MINI.parent


def path_render(plan: ExamplePlan) -> Callable[[object], np.ndarray]:
    """Full-frame render of a staged scene with Mitsuba's C++ path integrator."""
    sensor = sensor_of(plan.camera, SIZE, SIZE)
    depth = plan.effects.of("target").max_depth
    path = mi.load_dict({"type": "path", "max_depth": depth, "rr_depth": plan.render.rr_depth})
    return lambda opened: np.array(mi.render(opened.scene, integrator=path, sensor=sensor, spp=SPP, seed=1))


def one_pass(plan: ExamplePlan) -> tuple[float, float]:
    """Seconds of our pass and of `path`, the scene being there."""
    body = body_of(merge([clean(plan.target, SPECS), surroundings(plan, SPECS)]),
                   features=frozenset(plan.effects.features))
    depth = plan.effects.of("target").max_depth
    view, pixels = passes.ViewSensor(camera=plan.camera, render=plan.render), np.arange(SIZE * SIZE)
    render = path_render(plan)
    with open_scene(body, plan.target_light) as opened:
        ours, theirs = common.best([lambda: passes.radiance(view, opened, pixels, max_depth=depth, spp=SPP, seed=1),
                                    lambda: render(opened)])
    return ours, theirs


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
    passes = ratio_of([one_pass(plan) for plan in mini])
    print(f"one pass, image + shading + specular part + errors, over path alone: {passes:.2f}x (bound {ONE_PASS}x)")
    tuples = {}
    for name, plans in (("object", paper), ("i_s and i_t on the frame", mini)):
        works = [(partial(whole_tuple, plan), partial(three_renders, plan, SPECS)) for plan in plans]
        tuples[name] = ratio_of([common.best(pair, 3) for pair in works])
        print(f"whole tuple, {name}, over three path renders: {tuples[name]:.2f}x (bound {TUPLE}x)")
    return 0 if passes <= ONE_PASS and tuples["object"] <= TUPLE else 1


if __name__ == "__main__":
    sys.exit(main())
