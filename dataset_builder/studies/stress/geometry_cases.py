"""Geometry that is hard to render: far off, tiny, huge, flat, doubled, folded, inside out."""

import math

import numpy as np

from dataset_builder.geometry.edges import corner_normals, unit
from dataset_builder.geometry.rough_base import bounding_radius, displace, rough_base
from dataset_builder.rendering.scene.triangle_soup import Soup, merge
from dataset_builder.seeding import rng
from dataset_builder.studies.stress.bench import HOMOGENEOUS, Shot, at, judged, off_by, over_pixels, render, sigmas
from dataset_builder.studies.stress.case import SIGMAS, CaseMeasured, Size, hard_case
from dataset_builder.studies.stress.scenes import (
    ball,
    ball_mesh,
    bare,
    box,
    box_mesh,
    camera,
    floor,
    light,
    lit_by,
    matte,
    quad,
    standing,
)

SUN = lit_by(light("sun", math.pi, direction=(0.3, 0.5, -1)))
SUN_AND_SKY = lit_by(*SUN.lights, light("dome", 0.5))
SEEN = Shot(camera=camera(), replicas=4)
DEVIATION = "largest deviation, relative"


def same_as(size: Size, soup: Soup, plain: Soup, shot: Shot = SEEN) -> CaseMeasured:
    """The picture of a soup against that of another, under sun and sky with the same random numbers."""
    picture, truth = (render(each, SUN_AND_SKY, shot, size) for each in (soup, plain))
    off = max(off_by(getattr(picture, name), getattr(truth, name)) for name in ("image", "shading"))
    return judged(picture, max(off, off_by(picture.mask[..., None], truth.mask[..., None])))


@hard_case(name="geometry/duplicate-faces", bound=1e-4, figure=DEVIATION,
           expectation="a ball with every face doubled looks like the ball itself",
           failure="black speckle: a face shades its twin")
def duplicate_faces(size: Size) -> CaseMeasured:
    """Bit-equal corners."""
    one = ball(matte())
    return same_as(size, merge([one, one]), one)


@hard_case(name="geometry/coplanar-faces", bound=1e-5, figure=DEVIATION,
           expectation="two sheets in one place, cut into other triangles, are lit as one: S is E cos / pi",
           failure="black triangles: rays that leave one sheet meet the other")
def coplanar_faces(size: Size) -> CaseMeasured:
    """Whose colour is seen is left open, so only S is judged."""
    sheets = [quad(matte(albedo), (-9, -9, -1), (18, 0, 0), (0, 18, 0), cells=cells)
              for albedo, cells in ((0.8, (7, 5)), (0.2, (4, 9)))]
    picture = render(merge(sheets), SUN, Shot(camera=camera((0, -4, 1.5), (0, 0, -1), 30), max_depth=2), size)
    return judged(picture, off_by(picture.shading, _cosine((0, 0, 1))), diffuse=False)


def _cosine(normal: tuple[float, float, float]) -> float:
    """S under the sun: E cos / pi with E = pi."""
    toward = -np.array(SUN.lights[0].direction)
    return float(toward @ np.array(normal) / np.linalg.norm(toward))


@hard_case(name="geometry/zero-area-faces", bound=1e-4, figure=DEVIATION,
           expectation="faces without area, points and lines, change nothing",
           failure="NaN normals that spread, or slits where a face without area hides its neighbours")
def zero_area_faces(size: Size) -> CaseMeasured:
    """Repeated corners, and three corners in a row, with normals from `geometry.edges`."""
    mesh = box_mesh((-0.8, -0.8, -0.8), (0.8, 0.8, 0.8))
    extra = np.array([[0, 0, 0], [1, 1, 3], [0, len(mesh.positions), 3], [3, len(mesh.positions), 0]])
    flat = bare(np.concatenate([mesh.positions, mesh.positions[[0, 3]].mean(axis=0, keepdims=True)]),
                np.concatenate([mesh.faces, extra]))
    return same_as(size, standing(flat, matte()), standing(mesh, matte()))


@hard_case(name="geometry/needle-faces", bound=1e-3, figure=DEVIATION,
           expectation="a floor cut into slivers a thousand times as long as wide is lit as a whole one",
           failure="dark stripes: rays miss thin triangles, or leave them from the wrong place")
def needle_faces(size: Size) -> CaseMeasured:
    """S is E cos / pi everywhere."""
    sheet = quad(matte(), (-8, -8, -1), (16, 0, 0), (0, 16, 0), cells=(1000, 1))
    picture = render(sheet, SUN, Shot(camera=camera((0, -4, 1.5), (0, 0, -1), 30), max_depth=2), size)
    return judged(picture, off_by(picture.shading, _cosine((0, 0, 1))))


@hard_case(name="geometry/inverted-faces", bound=1e-4, figure=DEVIATION,
           expectation="a box with every other face inside out looks like the box itself",
           failure="black triangles: a face seen from its back is taken for unlit")
def inverted_faces(size: Size) -> CaseMeasured:
    """Two-sided surfaces are lit on the viewer's side."""
    mesh = box_mesh((-0.8, -0.8, -0.8), (0.8, 0.8, 0.8))
    faces = mesh.faces.copy()
    faces[::2] = faces[::2, ::-1]
    return same_as(size, standing(bare(mesh.positions, faces), matte()), standing(mesh, matte()))


@hard_case(name="geometry/folded-rough-mesh", bound=0.02, figure="how far the brightest S exceeds the sky, relative",
           expectation="a rough mesh that folds and intersects itself is lit by no more than the sky above it",
           failure="NaN or fireflies where faces meet at angle 0, or a mask with holes")
def folded_rough_mesh(size: Size) -> CaseMeasured:
    """Noise of half the object's radius. No point of a scene in a white furnace sees more than the furnace, whatever
    its albedo."""
    clean = box_mesh((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    base = rough_base(clean, edge_length=0.15, rounds=1, crease_angle=30)
    mesh = displace(base.mesh, sigma=0.5, radius=bounding_radius(clean), direction="isotropic", rng=rng(1, "fold"))
    albedo = 0.8
    soup = standing(mesh, matte(albedo), normals=corner_normals(mesh, creases=base.creases))
    picture = render(soup, lit_by(light("dome")), Shot(camera=camera()), size)
    also = [] if picture.mask.mean() > 0.1 and picture.s.max() > 0.5 else ["expected an object in the sky's light"]
    split = np.abs(picture.image - picture.specular - albedo * picture.shading).max()
    also += [] if split < HOMOGENEOUS else [f"I = D S, but for the sky itself: off by {split:g}"]
    noise = picture.shading.std(axis=0, ddof=1).max() / math.sqrt(len(picture.shading))
    return judged(picture, max(0.0, picture.s.max() - 1 - 5 * noise), diffuse=False, also=tuple(also))


@hard_case(name="geometry/object-inside-another", bound=1e-4, figure=DEVIATION,
           expectation="an object inside a closed one is not seen, and changes nothing",
           failure="a mask that is not empty, or bright specks: rays pass between triangles")
def object_inside_another(size: Size) -> CaseMeasured:
    """The inner one is the target, so the mask is empty."""
    shell, inner = box(matte(), (-1, -1, -1), (1, 1, 1)), ball(matte(0.9), radius=0.7)
    picture, truth = (render(soup, SUN_AND_SKY, SEEN, size) for soup in (merge([inner, shell]), shell))
    also = () if not picture.mask.any() else (f"mask: expected 0, got {picture.mask.max():g}",)
    return judged(picture, off_by(picture.shading, truth.shading), also=also)


@hard_case(name="geometry/one-triangle", bound=0.01, figure="deviation of the mask's area, relative",
           expectation="a scene of one triangle is lit by E cos / pi, and covers what its projection covers",
           failure="an empty picture: a bounding box without volume")
def one_triangle(size: Size) -> CaseMeasured:
    """Facing the camera, so that its share of the frame is known: area over (2 d tan(fov / 2))^2."""
    soup = standing(bare(np.array([[-1, 0, -0.5], [1, 0, -0.5], [0, 0, 1]]), [[0, 1, 2]]), matte())
    picture = render(soup, SUN, Shot(camera=camera((0, -4, 0)), max_depth=2), size)
    share = 1.5 / (8 * math.tan(math.radians(20))) ** 2
    off = off_by(picture.shading, _cosine((0, -1, 0)), picture.same)
    also = () if off < 1e-5 else (f"S: expected E cos / pi, got it off by {off:g}",)
    return judged(picture, abs(picture.mask.mean() / share - 1), also=also)


@hard_case(name="geometry/many-triangles", bound=SIGMAS, figure="worst |z| of pixels and picture",
           expectation="a ball of two million triangles (200 thousand in a small run) is lit as the sphere is",
           failure="speckle or holes: triangles smaller than the distance at which rays start")
def many_triangles(size: Size) -> CaseMeasured:
    """The sun stands behind the camera, so that no pixel is at the terminator; judged where the sphere fills pixels."""
    segments = round(math.sqrt(size.faces / 4))
    seen = camera((0, -4, 0), fov=30)
    shot = Shot(camera=seen, max_depth=2)
    soup = ball(matte(), segments=segments)
    picture = render(soup, lit_by(light("sun", math.pi, direction=(0, 1, 0))), shot, size)

    def cosine(eye: np.ndarray, rays: np.ndarray) -> np.ndarray:
        along = -(rays @ eye)
        depth = along - np.sqrt(np.maximum(along**2 - eye @ eye + 1, 0))
        return -(eye + depth[..., None] * rays)[..., 1]
    truth = np.repeat(over_pixels(seen, at(shot, size), cosine)[..., None], 3, axis=-1)
    also = () if len(soup.corners) > 0.9 * size.faces else (f"expected {size.faces} faces, got {len(soup.corners)}",)
    return judged(picture, sigmas(picture.shading, truth, where=picture.same), also=also)


@hard_case(name="geometry/endless-floor", bound=1e-4, figure=DEVIATION,
           expectation="a floor of two triangles 4 km wide is lit evenly, E cos / pi, up to the horizon",
           failure="bands of speckle towards the horizon: rays start below the surface that they leave")
def endless_floor(size: Size) -> CaseMeasured:
    """Seen at a grazing angle."""
    shot = Shot(camera=camera((0, -4, 0), (0, 4, -1), 10), max_depth=2)
    picture = render(floor(half=2000, height=-1), SUN, shot, size)
    return judged(picture, off_by(picture.shading, _cosine((0, 0, 1))))


@hard_case(name="geometry/closed-room-is-dark", bound=1e-6, figure="largest S inside",
           expectation="no light of sun or sky enters a closed ball of many small triangles",
           failure="light leaks: rays slip through edges and vertices")
def closed_room_is_dark(size: Size) -> CaseMeasured:
    """The camera is inside; flat normals of the facets.

    One ray in some millions leaves a facet so close to its plane that it passes the next edge; it weighs a millionth.
    """
    mesh = ball_mesh(64, radius=2.0)
    flat = np.repeat(unit(mesh.area_normals)[:, None], 3, axis=1)
    shell = standing(mesh, matte(), normals=np.where(flat.any(axis=-1, keepdims=True), flat, (0, 0, 1)))
    inside, outside = (render(shell, SUN_AND_SKY, Shot(camera=seen, replicas=4), size)
                       for seen in (camera((0, -1, 0.3), (0, 1, -0.2), 80), camera((0, -6, 0.3), (0, 0, 0), 20)))
    full = all(picture.mask.min() > 1 - 1e-6 for picture in (inside, outside))
    also = () if full and outside.s.min() > 0 else ("expected the object in every pixel, and lit outside",)
    return judged(inside, inside.shading.max(), also=also)
