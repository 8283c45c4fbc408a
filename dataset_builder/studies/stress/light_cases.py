"""Lights at extreme places, sizes and energies, compared with formulas."""

import math

import numpy as np

from dataset_builder.planning.scene.arrangement import TARGET_INSTANCE
from dataset_builder.rendering.scene.triangle_soup import merge
from dataset_builder.studies.stress.bench import Shot, at, clear_of, judged, on_floor, render, sigmas
from dataset_builder.studies.stress.case import SIGMAS, Case, CaseMeasured, Size, hard_case
from dataset_builder.studies.stress.scenes import WIDE, Triple, ball, box, camera, floor, light, lit_by, matte, quad

HIGH = 7.0
"""Height of walls, in metres."""

DIRECT = 2
"""Longest path: camera, surface, light."""

OBLIQUE = Shot(camera=camera((0, -4, 1.5), (0, 0, 0), 30), max_depth=DIRECT)
WORST = "worst |z| of pixels and picture"
DEVIATION = "largest deviation, relative"


def sphere_over_floor(size: Size, shot: Shot, radius: float, height: float) -> CaseMeasured:
    """S under a ball light: L r^2 h / d^3, exact while all of the ball is above the floor."""
    power = 1 / radius**2 if radius < 1 else 1.0
    lamp = light("sphere", power, position=(0, 0, height), size=radius)
    picture = render(floor(), lit_by(lamp), shot, size)
    truth = on_floor(shot.camera, at(shot, size), lambda p: power * radius**2 * height / distance(p, height) ** 3)
    clear = clear_of(shot.camera, at(shot, size), (0, 0, height), radius)
    return judged(picture, sigmas(picture.shading, truth, where=clear), where=clear)


def distance(points: np.ndarray, height: float, x: float = 0.0, y: float = 0.0) -> np.ndarray:
    """Metres from points (..., 3) to (x, y, height)."""
    return np.linalg.norm(points - np.array([x, y, height]), axis=-1)


touching = Case(
    name="light/touching", bound=SIGMAS, figure=WORST,
    measure=lambda size: sphere_over_floor(size, OBLIQUE, 0.15, 0.15),
    expectation="a ball light lying on the floor lights it as the formula L r^2 h / d^3 says",
    failure="a dark or bright ring around the point of contact: lost shadow rays, or unbounded densities")

tiny = Case(
    name="light/tiny", bound=SIGMAS, figure=WORST, measure=lambda size: sphere_over_floor(size, OBLIQUE, 1e-4, 1.0),
    expectation="a ball light of radius 1e-4 lights the floor as a point of its power does",
    failure="black, infinite or blotchy S: the cone under which the ball is seen vanishes in float32")

small = Case(
    name="light/small", bound=SIGMAS, figure=WORST, measure=lambda size: sphere_over_floor(size, OBLIQUE, 3e-3, 1.0),
    expectation="a ball light of 3 mm at 1 m lights the floor as a point of its power does",
    failure="S some per cent too bright, and blotchy: the density of directions has lost its digits")


@hard_case(name="light/room-sized-ball", bound=SIGMAS, figure=WORST,
           expectation="a ball light of radius 3 m, just above the floor, lights it as the formula says",
           failure="S off by a factor: the ball is sampled as if it were far away")
def room_sized_ball(size: Size) -> CaseMeasured:
    """Fills half of the sky."""
    return sphere_over_floor(size, Shot(camera=camera((0, -5.5, 0.5), (0, -3, 0), 20), max_depth=DIRECT), 3.0, 3.05)


@hard_case(name="light/room-sized-square", bound=SIGMAS, figure=WORST,
           expectation="a square light as wide as the room lights the floor by its form factor",
           failure="S off by a factor, or noise that never settles: one technique takes all the weight")
def room_sized_square(size: Size) -> CaseMeasured:
    """Form factor of a parallel rectangle: Howell, "A Catalog of Radiation Heat Transfer Configuration Factors",
    B-3."""
    side, height = 6.0, 2.0
    shot = Shot(camera=camera((0, -2, 1.2), (0, 0, 0), 30), max_depth=DIRECT)
    picture = render(floor(), lit_by(light("area", position=(0, 0, height), size=side)), shot, size)
    truth = on_floor(shot.camera, at(shot, size), lambda p: _square(p, side / 2, height))
    return judged(picture, sigmas(picture.shading, truth))


def _square(points: np.ndarray, half: float, height: float) -> np.ndarray:
    def corner(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        p, q = np.sqrt(1 + a * a), np.sqrt(1 + b * b)
        return (a / p * np.arctan(b / p) + b / q * np.arctan(a / q)) / (2 * math.pi)
    right, left = ((side * half - points[..., 0]) / height for side in (1, -1))
    back, front = ((side * half - points[..., 1]) / height for side in (1, -1))
    return corner(right, back) - corner(left, back) - corner(right, front) + corner(left, front)


LAMPS_INSIDE = lit_by(light("sphere", 20.0, position=(0.2, 0.1, 0.1), size=0.2),
                      light("point", 5.0, position=(0, 0, 0)))


@hard_case(name="light/inside-the-object", bound=0.0, figure="largest S outside, in units of S without the object",
           expectation="lights inside a closed object with flat faces light nothing outside it",
           failure="bright specks: rays slip through the edges between triangles")
def inside_the_object(size: Size) -> CaseMeasured:
    """The shell is seen from outside only: everything is black."""
    shot = Shot(camera=camera((-2, -4, 1.5), (0, 0, -0.3)))
    shell, ground = box(matte(), (-1, -1, -1), (1, 1, 1), TARGET_INSTANCE), floor(height=-1.2)
    picture, bare = (render(soup, LAMPS_INSIDE, shot, size) for soup in (merge([shell, ground]), ground))
    also = () if picture.mask.mean() > 0.1 and bare.s.mean() > 0 else ("expected an object and a light that shines",)
    return judged(picture, picture.shading.max() / bare.s.mean(), also=also)


@hard_case(name="light/inside-a-smooth-object", bound=1e-3, figure="mean S outside, in units of mean S inside",
           expectation="of the light inside a closed smooth-shaded object less than a thousandth comes out",
           failure="objects that glow: directions above the shading normal's horizon but below the facet's pass it")
def inside_a_smooth_object(size: Size) -> CaseMeasured:
    """A ball of flat facets with the normals of the sphere."""
    shell = ball(matte())
    outside, inside = (render(shell, LAMPS_INSIDE, Shot(camera=seen), size)
                       for seen in (camera((0, -4, 1.5), fov=20), camera((0, -0.9, 0), (0, 0.9, 0))))
    return judged(outside, outside.s.mean() / inside.s.mean())


@hard_case(name="light/behind-a-wall", bound=0.0, figure="largest S in the shadow, in units of S without the wall",
           expectation="a wall without thickness keeps all direct light from what is behind it",
           failure="a bright seam where wall and floor meet, or specks on the wall: rays start on the wrong side")
def behind_a_wall(size: Size) -> CaseMeasured:
    """The seam is in the picture, and so is the wall's dark side."""
    lamp = lit_by(light("point", 5.0, position=(0.3, 1, 0.7)), light("area", 5.0, position=(0, 1.5, 0.5), size=0.5,
                                                                     direction=(0, -1, 0)))
    wall = quad(matte(), (-WIDE, 0, 0), (2 * WIDE, 0, 0), (0, 0, HIGH))
    shot = Shot(camera=camera((0, -4, 2), (0, -0.5, 0), 30), max_depth=DIRECT)
    picture, bare = (render(soup, lamp, shot, size) for soup in (merge([floor(), wall]), floor()))
    also = () if bare.s.mean() > 0 else ("expected a light that shines without the wall",)
    return judged(picture, picture.shading.max() / bare.s.mean(), also=also)


@hard_case(name="light/grazing", bound=SIGMAS, figure=WORST,
           expectation="a point light half a degree above the horizon lights the floor by its cosine",
           failure="streaks or black pixels: shadow rays start below the surface that they leave")
def grazing(size: Size) -> CaseMeasured:
    """2 cm above the floor, 2 m away."""
    shot = Shot(camera=camera((0, -4, 1.5), (0, 0, 0), 20), max_depth=DIRECT)
    picture = render(floor(), lit_by(light("point", 100.0, position=(2, 2, 0.02))), shot, size)
    truth = on_floor(shot.camera, at(shot, size), lambda p: 100 * 0.02 / distance(p, 0.02, 2.0, 2.0) ** 3 / math.pi)
    return judged(picture, sigmas(picture.shading, truth))


@hard_case(name="light/on-the-floor", bound=1e-3, figure="largest S of the floor, in units of S with the light lifted",
           expectation="a point light exactly on the floor lights none of it, and no value is infinite",
           failure="NaN or a blinding pixel where the distance vanishes")
def on_the_floor(size: Size) -> CaseMeasured:
    """cos = 0 while 1 / d^2 has no bound."""
    shot = OBLIQUE
    flat, lifted = (render(floor(), lit_by(light("point", position=(0, 0, z))), shot, size) for z in (0.0, 1.0))
    return judged(flat, flat.shading.max() / lifted.s.max())


@hard_case(name="light/at-the-camera", bound=SIGMAS, figure=WORST,
           expectation="a point light in the camera's place lights the floor as the formula says, without shadows",
           failure="NaN, or black specks where shadow ray and camera ray coincide")
def at_the_camera(size: Size) -> CaseMeasured:
    """Every shadow ray goes back along the camera ray."""
    place: Triple = OBLIQUE.camera.position
    picture = render(floor(), lit_by(light("point", position=place)), OBLIQUE, size)
    x, y, z = place
    truth = on_floor(OBLIQUE.camera, at(OBLIQUE, size), lambda p: z / distance(p, z, x, y) ** 3 / math.pi)
    return judged(picture, sigmas(picture.shading, truth))
