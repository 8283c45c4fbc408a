"""One scene at many scales and places: the picture is the same, though float32 has few digits far from the origin."""

import math

import numpy as np

from dataset_builder.label.light_plan import IlluminationPlan, LightPlan
from dataset_builder.label.scene_plan import CameraPlan
from dataset_builder.light_kinds import LENGTHS, LIGHT_KINDS
from dataset_builder.studies.stress.bench import Picture, Shot, judged, moved, render
from dataset_builder.studies.stress.case import Case, CaseMeasured, Size
from dataset_builder.studies.stress.scenes import ball, camera, light, lit_by, matte, still_life

SPECKLED = "share of pixels more than 1% off"


def speckled(picture: Picture, truth: Picture) -> float:
    """Share of pixels whose S differs by more than a hundredth, relative to the mean."""
    off = np.abs(picture.shading - truth.shading).max(axis=(0, 3)) / truth.shading.mean()
    return float(np.mean(~(off <= 0.01)))


def elsewhere(size: Size, scale: float, offset: tuple[float, float, float]) -> CaseMeasured:
    """A scene, scaled and moved in double precision, against the scene itself, both in the frame of their object."""
    shift = np.array(offset)
    lamps = (light("area", 8, position=(1.5, -2, 2), direction=(-1.5, 2, -2), size=0.8),
             light("point", 3, position=(-1, -2, 1.5)), light("sun", math.pi, direction=(0.3, 0.5, -1)),
             light("dome", 0.5))
    scene, seen = still_life(ball(matte(0.7))), camera()
    plain = render(scene, lit_by(*lamps), Shot(camera=seen, framed=True, replicas=4), size)
    lights = IlluminationPlan(lights=tuple(_lamp(lamp, scale, shift) for lamp in lamps), open=())
    there = render(moved(scene, scale, shift), lights,
                   Shot(camera=_camera(seen, scale, shift), framed=True, replicas=4), size)
    also = [f"depth: expected {scale:g} times as large, got {ratio:g}"
            for ratio in [float(there.depth.sum() / plain.depth.sum())] if not math.isclose(ratio, scale, rel_tol=1e-3)]
    return judged(there, speckled(there, plain), also=tuple(also))


def _lamp(lamp: LightPlan, scale: float, shift: np.ndarray) -> LightPlan:
    power = scale ** LENGTHS[LIGHT_KINDS[lamp.kind].quantity]
    return lamp.model_copy(update={"position": _place(lamp.position, scale, shift), "size": lamp.size * scale,
                                   "radiance": tuple(value * power for value in lamp.radiance)})


def _camera(seen: CameraPlan, scale: float, shift: np.ndarray) -> CameraPlan:
    return seen.model_copy(update={"position": _place(seen.position, scale, shift),
                                   "target": _place(seen.target, scale, shift)})


def _place(point: tuple[float, float, float], scale: float, shift: np.ndarray) -> tuple[float, ...]:
    return tuple((np.array(point) * scale + shift).tolist())


scaled_down = Case(
    name="geometry/scaled-1e-3", bound=0.01, figure=SPECKLED, measure=lambda size: elsewhere(size, 1e-3, (0, 0, 0)),
    expectation="a scene a thousand times smaller gives the same picture",
    failure="self-shadow speckle and lost contact shadows: rays start further off than the scene is large")

scaled_up = Case(
    name="geometry/scaled-1e3", bound=0.01, figure=SPECKLED, measure=lambda size: elsewhere(size, 1e3, (0, 0, 0)),
    expectation="a scene a thousand times larger gives the same picture",
    failure="pixels that see nothing or shade themselves: clipped rays, lost precision of coordinates")

moved_far = Case(
    name="geometry/moved-1e4", bound=0.01, figure=SPECKLED, measure=lambda size: elsewhere(size, 1.0, (1e4, -1e4, 1e4)),
    expectation="a scene 10 km from the origin gives the same picture",
    failure="steps, cracks and speckle: float32 resolves a millimetre there")

tiny_and_far = Case(
    name="geometry/tiny-and-far", bound=0.01, figure=SPECKLED,
    measure=lambda size: elsewhere(size, 0.1, (1e3, 1e3, -1e3)),
    expectation="a scene of a tenth, a kilometre from the origin, gives the same picture",
    failure="as for a small scene and for a distant one, but ten thousand times worse")
