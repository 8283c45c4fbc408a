"""How rough a rough mesh is, measured against the clean one: distances, normals, volume, and how displacements vary.

Both meshes are moved to the origin and scaled to the clean one's bounding radius: Open3D measures in float32, so that
distances are good to about 1e-7 radii.
"""

from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from dataset_builder.geometry.edges import closed, edges_of, unit
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.geometry.rough_base import bounding_radius
from dataset_builder.label.roughness_record import ShapeRoughness

SAMPLES = 4096
"""Points on each surface."""
MOST_FACES = 8192
"""Faces of the rough mesh whose normals are looked at, evenly chosen where there are more."""
PAIRED = 1024
"""Points that the variogram is made of."""
BAND = (0.02, 0.2)
"""Distances of the variogram, in bounding radii."""
BINS, LEAST_PAIRS = 6, 16
SAME_SIDE = 0.5
"""Cosine between the clean normals at two points above which they count as points of one sheet."""
AGREED = 0.5
"""Cosine between rough and clean normals from which on the nearest surface is taken for the one that was displaced."""
REACH = 3.0
"""How far that one may be, in root mean square distances."""
NOTHING = 1e-6
"""Radii: a displacement below this is rounding."""


class Roughness(ShapeRoughness):
    """What `measure_roughness` found."""

    rms: float
    """Distance of the rough mesh's vertices from the clean surface, root mean square, in bounding radii."""
    maximum: float
    """The largest of them."""
    radius: float
    """Of the clean mesh, metres."""


def measure_roughness(rough: TriangleMesh, clean: TriangleMesh, rng: np.random.Generator) -> Roughness:
    """How far `rough` is from `clean`, and in which way. rng: draws the points on both surfaces."""
    radius = bounding_radius(clean)
    rough, clean = _in_radii(rough, clean)
    onto = CleanSurface(clean)
    used = np.zeros(len(rough.positions), bool)
    used[rough.faces] = True
    vertices = onto.scene.distance(rough.positions[used])
    points, normals = sample(rough, SAMPLES, rng)
    away = onto.scene.distance(points)
    reach = REACH * _rms(away) + NOTHING
    feet, faced = onto.origin(points, normals, reach)
    back = RayScene([(rough.positions, rough.faces, 1)]).distance(sample(clean, SAMPLES, rng)[0])
    angle, outwards = _angles(normals, faced), np.einsum("ij,ij->i", points - feet, faced)
    signed = np.copysign(np.linalg.norm(points - feet, axis=1), outwards)
    extents = _ratios(np.ptp(rough.bounds, axis=0), np.ptp(clean.bounds, axis=0)).tolist()
    return Roughness(
        rms=_rms(vertices), maximum=float(vertices.max()), radius=radius,
        to_clean_rms=_rms(away), to_clean_95=_percentile(away, 95), to_rough_rms=_rms(back),
        to_rough_95=_percentile(back, 95), normal_median=_percentile(angle, 50), normal_95=_percentile(angle, 95),
        volume=_ratio(rough.volume, clean.volume) if closed(edges_of(clean.faces)) else 0.0,
        area=_ratio(_areas(rough).sum(), _areas(clean).sum()),
        extent_x=extents[0], extent_y=extents[1], extent_z=extents[2],
        flipped=_flipped(rough, onto, reach),
        spectrum_slope=spectrum_slope(*(each[::SAMPLES // PAIRED] for each in (feet, signed, faced))))


def vertex_distances(rough: TriangleMesh, clean: TriangleMesh) -> np.ndarray:
    """(V,) distance of every vertex of `rough` from the surface of `clean`, in bounding radii of the latter: what
    `Roughness.rms` and `Roughness.maximum` are of, for the vertices that faces use."""
    rough, clean = _in_radii(rough, clean)
    return RayScene([(clean.positions, clean.faces, 1)]).distance(rough.positions)


def _in_radii(rough: TriangleMesh, clean: TriangleMesh) -> tuple[TriangleMesh, TriangleMesh]:
    """Both about the middle of the clean one's box, in its bounding radii."""
    radius, centre = bounding_radius(clean), clean.bounds.mean(axis=0)
    rough, clean = (replace(mesh, positions=(mesh.positions - centre) / radius) for mesh in (rough, clean))
    return rough, clean


class CleanSurface:
    """A clean mesh, and which point of it a point of the rough mesh came from.

    The nearest point is not always that: parts of furniture touch, so that two sheets lie in one place and face
    opposite ways, and noise carries thin things through each other.
    """

    def __init__(self, mesh: TriangleMesh):
        self._mesh = mesh
        self.scene = RayScene([(mesh.positions, mesh.faces, 1)])

    @cached_property
    def _by_side(self) -> list[tuple[np.ndarray, RayScene]]:
        """Six directions, and the faces that look most nearly along them."""
        sides = np.concatenate([np.eye(3), -np.eye(3)])
        of_face = (self._mesh.area_normals @ sides.T).argmax(axis=1)
        return [(side, RayScene([(self._mesh.positions, faces, 1)])) for number, side in enumerate(sides)
                if len(faces := self._mesh.faces[of_face == number])]

    def origin(self, points: np.ndarray, normals: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Where (N, 3) points with unit normals were before they moved, and the unit normals there, (N, 3) each.

        That is the nearest point of the surface; where its normal differs by more than 60 degrees, of the nearest
        points that look to each of six sides, those not further off than `reach` (or the nearest), the one whose
        normal differs least.
        """
        feet, faced = self.scene.closest(points)
        unlike = np.flatnonzero(np.einsum("ij,ij->i", normals, faced) < AGREED)
        best = np.einsum("ij,ij->i", normals, faced)
        for side, scene in self._by_side if len(unlike) else ():
            tried = unlike[normals[unlike] @ side > 0]
            if not len(tried):
                continue
            other, looks = scene.closest(points[tried])
            alike = np.einsum("ij,ij->i", normals[tried], looks)
            better = (alike > best[tried]) & (np.linalg.norm(other - points[tried], axis=1) <= reach)
            taken = tried[better]
            feet[taken], faced[taken], best[taken] = other[better], looks[better], alike[better]
        return feet, faced


def sample(mesh: TriangleMesh, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """(count, 3) points spread over the surface by area, one in each of `count` equal shares of it in the order of its
    faces, and (count, 3) unit normals of their faces."""
    ends = np.cumsum(_areas(mesh))
    place = (np.arange(count) + rng.random(count)) / count * ends[-1]
    face = np.minimum(np.searchsorted(ends, place, side="right"), len(ends) - 1)
    # R. Osada et al., "Shape Distributions", ACM TOG 2002, equation 1
    root, share = np.sqrt(rng.random(count))[:, None], rng.random(count)[:, None]
    a, b, c = np.moveaxis(mesh.positions[mesh.faces[face]], 1, 0)
    return (1 - root) * a + root * (1 - share) * b + root * share * c, unit(np.cross(b - a, c - a))


def spectrum_slope(points: np.ndarray, displacement: np.ndarray, normals: np.ndarray) -> float:
    """Exponent of the spatial power P(k) ~ k^slope of a field on a surface, from -4 to -2.

    points: (N, 3) in bounding radii. displacement: (N,). normals: (N, 3) unit vectors; only points of one sheet are
    compared. Of pairs at a distance h within `BAND`, the log of the mean squared difference of the displacement (twice
    the variogram) is fitted by a line over log h; a field with P(k) ~ k^-(2 + z) has one that grows as h^z, 0 < z < 2
    (J.-P. Chiles, P. Delfiner, "Geostatistics", 2012, section 2.5). So -2 stands for all that is flatter, as white
    noise is, and -4 for all that is steeper, as a smooth bulge is. 0 where nothing moved or too few points are near
    each other.
    """
    if not len(points) or np.abs(displacement).max() < NOTHING:
        return 0.0
    pairs = cKDTree(points).query_pairs(BAND[1], output_type="ndarray")
    one, other = pairs[np.einsum("ij,ij->i", normals[pairs[:, 0]], normals[pairs[:, 1]]) > SAME_SIDE].T
    apart = np.linalg.norm(points[one] - points[other], axis=1)
    squares = (displacement[one] - displacement[other]) ** 2
    edges = np.geomspace(*BAND, BINS + 1)
    slot = np.searchsorted(edges, apart, side="right") - 1
    found = [(np.log(apart[inside]).mean(), np.log(squares[inside].mean())) for number in range(BINS)
             if (inside := slot == number).sum() >= LEAST_PAIRS and squares[inside].any()]
    if len(found) < 2:
        return 0.0
    x, y = np.array(found).T
    growth = np.polynomial.polynomial.polyfit(x, y, 1)[1]
    return -2.0 - float(np.clip(growth, 0, 2))


def _flipped(rough: TriangleMesh, onto: CleanSurface, reach: float) -> float:
    """Share of faces with an area; see `ShapeRoughness`."""
    some = rough.positions[rough.faces[::-(-len(rough.faces) // MOST_FACES)]]
    normals = unit(np.cross(some[:, 1] - some[:, 0], some[:, 2] - some[:, 0]))
    _, faced = onto.origin(some.mean(axis=1), normals, reach)
    told = normals.any(axis=1) & faced.any(axis=1)
    return float(np.mean(np.einsum("ij,ij->i", normals, faced)[told] < 0)) if told.any() else 0.0


def _angles(normals: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Degrees between (N, 3) unit vectors, where both have a direction."""
    told = normals.any(axis=1) & others.any(axis=1)
    sine = np.linalg.norm(np.cross(normals[told], others[told]), axis=1)
    return np.degrees(np.arctan2(sine, np.einsum("ij,ij->i", normals[told], others[told])))


def _areas(mesh: TriangleMesh) -> np.ndarray:
    return np.linalg.norm(mesh.area_normals, axis=1) / 2


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _percentile(values: np.ndarray, share: float) -> float:
    return float(np.percentile(values, share)) if len(values) else 0.0


def _ratio(one: float, other: float) -> float:
    return float(_ratios(np.array(one), np.array(other)))


def _ratios(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """`one` over `other`, 0 where the latter is nothing: lengths, areas and volumes are in powers of the radius."""
    some = np.abs(other) > NOTHING
    return np.divide(one, other, out=np.zeros_like(other), where=some)
