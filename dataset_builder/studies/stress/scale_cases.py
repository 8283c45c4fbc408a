"""Energy, size and place at many scales: energy adds up, and a scene elsewhere or as large again looks the same."""

import math

import numpy as np

from dataset_builder.label.scene_plan import CameraPlan, IlluminationPlan, LightPlan
from dataset_builder.light_kinds import LENGTHS, LIGHT_KINDS
from dataset_builder.rendering.scene.triangle_soup import merge
from dataset_builder.seeding import rng
from dataset_builder.studies.stress.bench import Picture, Shot, at, judged, moved, off_by, on_floor, render, sigmas
from dataset_builder.studies.stress.case import SIGMAS, Case, CaseMeasured, Size, hard_case
from dataset_builder.studies.stress.light_cases import DEVIATION, DIRECT, HIGH, WORST, distance
from dataset_builder.studies.stress.scenes import WIDE, ball, camera, floor, light, lit_by, matte, quad, still_life

SPECKLED = "share of pixels more than 1% off"


@hard_case(name="light/strong-but-hidden", bound=SIGMAS, figure="|z| of the picture's mean",
           expectation="a strong light that a wall hides takes most samples, yet the weak one's S is unbiased",
           failure="S too dark by the share of samples that the hidden light takes")
def strong_but_hidden(size: Size) -> CaseMeasured:
    """Light sampling goes by unoccluded irradiance, thirty to one."""
    strong = light("point", 30.0, position=(0, 2, 1), weight=30.0)
    weak = light("point", 1.0, position=(0, -2, 1))
    wall = quad(matte(), (-WIDE, 0, 0), (2 * WIDE, 0, 0), (0, 0, HIGH))
    shot = Shot(camera=camera((0, -4, 2), (0, -2, 0), 20), max_depth=DIRECT)
    picture = render(merge([floor(), wall]), lit_by(strong, weak), shot, size)
    truth = on_floor(shot.camera, at(shot, size), lambda p: 1 / distance(p, 1.0, y=-2.0) ** 3 / math.pi)
    return judged(picture, sigmas(picture.shading, truth, pixels=False))


def scaled_energy(size: Size, factor: float) -> CaseMeasured:
    """The picture under lights of `factor` times the radiance, over the factor, against the picture itself."""
    def lamps(k: float) -> tuple[LightPlan, ...]:
        return (light("area", 8 * k, position=(1.5, -2, 2), direction=(-1.5, 2, -2), size=0.8),
                light("point", 3 * k, position=(-1, -2, 1.5)), light("dome", 0.2 * k))
    shot = Shot(camera=camera(), replicas=4)
    plain, scaled = (render(still_life(ball(matte(0.7))), lit_by(*lamps(k)), shot, size) for k in (1.0, factor))
    off = max(off_by(getattr(scaled, name) / factor, getattr(plain, name)) for name in ("image", "shading"))
    return judged(scaled, off)


energy_small = Case(
    name="light/energy-1e-6", bound=1e-5, figure=DEVIATION, measure=lambda size: scaled_energy(size, 1e-6),
    expectation="with a millionth of the energy, the same picture a million times darker, to rounding",
    failure="black or grainy pictures: a threshold takes little light for none")

energy_large = Case(
    name="light/energy-1e6", bound=1e-5, figure=DEVIATION, measure=lambda size: scaled_energy(size, 1e6),
    expectation="with a million times the energy, the same picture a million times brighter, to rounding",
    failure="clipped or overflowing values, or other paths: roulette went by absolute radiance")


@hard_case(name="light/thousand", bound=SIGMAS, figure=WORST,
           expectation="a thousand lights of unequal power add up to the sum of each one's formula",
           failure="too dark or too bright: lights left out, counted twice, or drawn with a wrong probability")
def thousand(size: Size) -> CaseMeasured:
    """Point lights over the floor; powers span a factor of 100."""
    random = rng(1, "thousand lights")
    places = np.stack([random.uniform(-3, 3, 1000), random.uniform(-3, 3, 1000), random.uniform(1, 2, 1000)], axis=-1)
    powers = 10 ** random.uniform(-2, 0, 1000)
    weights = powers / np.linalg.norm(places, axis=1) ** 2
    lamps = [light("point", float(power), position=tuple(place), weight=float(weight))
             for place, power, weight in zip(places.tolist(), powers, weights, strict=True)]
    shot = Shot(camera=camera((0, -4, 1.5), (0, 0, 0), 20), max_depth=DIRECT)
    picture = render(floor(), lit_by(*lamps), shot, size)

    def formula(points: np.ndarray) -> np.ndarray:
        total = np.zeros(points.shape[:-1])
        for (x, y, z), power in zip(places, powers, strict=True):
            total += power * z / distance(points, z, x, y) ** 3 / math.pi
        return total
    return judged(picture, sigmas(picture.shading, on_floor(shot.camera, at(shot, size), formula)))


@hard_case(name="light/sun-along-a-surface", bound=1e-4, figure=DEVIATION,
           expectation="a sun that travels exactly in the floor's plane lights none of it, and all of a wall facing it",
           failure="speckle on the floor: the sign of a cosine of 0 decides")
def sun_along_a_surface(size: Size) -> CaseMeasured:
    """S on the wall is E / pi."""
    wall = quad(matte(0.3), (-WIDE, 2, 0), (2 * WIDE, 0, 0), (0, 0, HIGH))
    shot = Shot(camera=camera((0, -4, 2), (0, 1, 0.5), 40), max_depth=DIRECT)
    picture = render(merge([floor(), wall]), lit_by(light("sun", math.pi, direction=(0, 1, 0))), shot, size)
    up = picture.normal[..., 2]
    truth = np.repeat(np.where(up > 0.5, 0.0, 1.0)[..., None], 3, axis=-1)
    both = picture.same & (up < 0.5), picture.same & (up > 0.5)
    also = () if all(part.any() for part in both) else ("expected floor and wall in the picture",)
    return judged(picture, off_by(picture.s, truth, picture.same), also=also)


@hard_case(name="light/two-sided", bound=1e-5, figure=DEVIATION,
           expectation="a surface is lit on the viewer's side, whichever way it winds, and black when lit from behind",
           failure="half of the picture black: faces seen from their back take no light")
def two_sided(size: Size) -> CaseMeasured:
    """Two halves that wind against each other, under a sun from the viewer's side and from the other."""
    halves = merge([quad(matte(), (-3, 0, -3), (3, 0, 0), (0, 0, 6)), quad(matte(), (3, 0, -3), (-3, 0, 0), (0, 0, 6))])
    shot = Shot(camera=camera((0, -3, 0)), max_depth=DIRECT)
    lit, dark = (render(halves, lit_by(light("sun", math.pi, direction=(0, y, 0))), shot, size) for y in (1, -1))
    return judged(lit, max(off_by(lit.shading, 1.0), float(dark.shading.max())))


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
                                   "length": lamp.length * scale,
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
