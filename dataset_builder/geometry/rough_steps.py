"""The steps that make a rough mesh of its base, as a plan has them: noise, bumps, smoothing, other triangles."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import ndtri

from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import crease_mask, edges_of, unit
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.random_fields import GaussianField, gaussian_field
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.geometry.remeshing import (
    decimated,
    smoothed,
    thin_faces,
    typical_edge,
    voxelised,
    without_holes,
)
from dataset_builder.geometry.rough_base import RoughBase, bounding_radius, displace, rough_base, vertex_normals
from dataset_builder.geometry.support import mirrored_up
from dataset_builder.label.example_plan import RoughPlan, RoughStep
from dataset_builder.seeding import rng

FINER = 0.5
"""A scan is coarsened where its typical edge is shorter than this share of what it should be."""
COARSEST = 0.08
"""Longest edge in bounding radii that coarsening aims at."""
STRAY = 0.002
"""Root mean square distance in bounding radii that coarsening may move the surface by: half of the default noise."""
TYPICAL = 0.5
"""Typical edge of a mesh in units of the longest, after midpoint splits."""
OUTLINE = 4.0
"""Widths of a bump beyond which it is 0: there it is 3e-4 of its height."""
PATCH = 3.0
"""Correlation length of where thin parts are lost, in thicknesses."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StepSetting:
    """What steps know beside the mesh that they change."""

    clean: TriangleMesh
    radius: float
    """Metres."""
    crease_angle: float
    """Degrees."""
    rng: np.random.Generator


def base_of(clean: TriangleMesh, *, edge_length: float, rounds: int, crease_angle: float, coarsen: bool,
            triangles: int) -> RoughBase:
    """The rough base of a 3DM; a scan is decimated first where `coarsen` asks for it.

    A mesh is a scan where it would still be more than twice as fine as a split CAD model after subdivision. Edges are
    never made longer than 0.08 bounding radii, and shorter where the surface would stray. Raises UserError as
    `rough_base` does.
    """
    if coarsen:
        clean = _coarsened(clean, min(edge_length, COARSEST * bounding_radius(clean)) * TYPICAL * 2**rounds)
    return rough_base(clean, edge_length=edge_length, rounds=rounds, crease_angle=crease_angle, max_faces=triangles)


def _coarsened(clean: TriangleMesh, wanted: float) -> TriangleMesh:
    """A scan with typical edges of `wanted` metres, or of half, a quarter ... of it where its shape needs them."""
    points = clean.positions[np.unique(clean.faces)]
    while typical_edge(clean) < FINER * wanted:
        coarse = decimated(clean, wanted)
        distance = RayScene([(coarse.positions, coarse.faces, 1)]).distance(points)
        if np.sqrt(np.mean(distance**2)) <= STRAY * bounding_radius(clean):
            return coarse
        wanted /= 2
    return clean


def needed_rounds(clean: TriangleMesh, *, edge_length: float, rounds: int) -> int:
    """How many of `rounds` rounds of subdivision leave a mesh no finer than a split CAD model: none for most scans."""
    finest = FINER * TYPICAL * edge_length
    return next((fewer for fewer in range(rounds, 0, -1) if typical_edge(clean) >= finest * 2**fewer), 0)


def roughened(base: RoughBase, clean: TriangleMesh, plan: RoughPlan) -> RoughBase:
    """The rough mesh in the object's frame. Equal arguments give equal bits; without noise, it is the base itself.

    Raises UserError where a step leaves nothing.
    """
    radius, seed = bounding_radius(clean), int(plan.seed)
    if not plan.steps:
        noisy = displace(base.mesh, sigma=plan.sigma, radius=radius, direction=plan.direction,
                         rng=rng(seed, "vertex noise"))
        made = replace(base, mesh=noisy)
    else:
        made = base
        for number, step in enumerate(plan.steps):
            made = STEPS[step.kind](made, step, StepSetting(clean=clean, radius=radius, crease_angle=plan.crease_angle,
                                                            rng=rng(seed, "step", number)))
    if not plan.above_support:
        return made
    return replace(made, mesh=mirrored_up(made.mesh, base.mesh.bounds[0, 2]))


def _white(made: RoughBase, step: RoughStep, setting: StepSetting) -> RoughBase:
    return replace(made, mesh=displace(made.mesh, sigma=step["sigma"], radius=setting.radius, direction=step.along,
                                       rng=setting.rng))


def _field(made: RoughBase, step: RoughStep, setting: StepSetting) -> RoughBase:
    field = gaussian_field(setting.rng, length=step["length"], octaves=int(step["octaves"]), gain=step["gain"],
                           components=3 if step.along == "isotropic" else 1)
    return _moved(made, field, step, setting)


def _scanlines(made: RoughBase, step: RoughStep, setting: StepSetting) -> RoughBase:
    axis = unit(setting.rng.standard_normal((1, 3)))[0]
    return _moved(made, gaussian_field(setting.rng, length=step["length"], axis=axis, stretch=step["stretch"]), step,
                  setting)


def _moved(made: RoughBase, field: GaussianField, step: RoughStep, setting: StepSetting) -> RoughBase:
    """Vertices moved by a field in bounding radii: by its three components, or by its one along normals."""
    if step["sigma"] == 0:
        return made
    offsets = step["sigma"] * setting.radius * field.at(made.mesh.positions / setting.radius)
    if offsets.shape[1] == 1:
        offsets = offsets * vertex_normals(made.mesh)
    return replace(made, mesh=replace(made.mesh, positions=made.mesh.positions + offsets))


def _bumps(made: RoughBase, step: RoughStep, setting: StepSetting) -> RoughBase:
    count, width = round(step["count"]), step["width"] * setting.radius
    centres, outwards = points_on(setting.clean, count, setting.rng)
    heights = step["height"] * setting.radius * setting.rng.uniform(0.5, 1, count)
    heights[setting.rng.uniform(size=count) < step["dents"]] *= -1
    mesh, normals = made.mesh, vertex_normals(made.mesh)
    offsets, tree = np.zeros_like(mesh.positions), cKDTree(mesh.positions)
    for centre, outward, height in zip(centres, outwards, heights, strict=True):
        near = np.sort(tree.query_ball_point(centre, OUTLINE * width)).astype(np.int64)
        square = np.sum((mesh.positions[near] - centre) ** 2, axis=1)
        # The other side of a thin board faces away and stays
        facing = np.clip(np.einsum("ni,i->n", normals[near], outward), 0, None)
        offsets[near] += (height * np.exp(-square / (2 * width**2)) * facing)[:, None] * normals[near]
    return replace(made, mesh=replace(mesh, positions=mesh.positions + offsets))


def points_on(mesh: TriangleMesh, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """(count, 3) points drawn uniformly by area, and the (count, 3) unit normals of their faces."""
    normals = mesh.area_normals
    summed = np.cumsum(np.linalg.norm(normals, axis=1))
    chosen = np.searchsorted(summed, rng.uniform(0, summed[-1], count), side="right").clip(0, len(mesh.faces) - 1)
    u, v = rng.uniform(size=(2, count))
    root = np.sqrt(u)
    weights = np.stack([1 - root, root * (1 - v), root * v], axis=1)
    return np.einsum("nk,nki->ni", weights, mesh.corners[chosen]), unit(normals[chosen])


def _smooth(made: RoughBase, step: RoughStep, setting: StepSetting) -> RoughBase:
    return replace(made, mesh=smoothed(made.mesh, int(step["rounds"])))


def _decimate(made: RoughBase, step: RoughStep, setting: StepSetting) -> RoughBase:
    mesh = decimated(made.mesh, step["edge"] * setting.radius)
    return made if mesh is made.mesh else _with_creases(mesh, setting)


def _voxels(made: RoughBase, step: RoughStep, setting: StepSetting) -> RoughBase:
    """Nothing stays sharp: a grid has no edges of the surface."""
    return RoughBase(mesh=voxelised(made.mesh, step["size"] * setting.radius), creases=np.empty((0, 2), np.int64))


def _thin(made: RoughBase, step: RoughStep, setting: StepSetting) -> RoughBase:
    mesh = made.mesh
    lost = thin_faces(mesh, step["thickness"] * setting.radius)
    where = gaussian_field(setting.rng, length=PATCH * step["thickness"]).at(mesh.corners.mean(axis=1) / setting.radius)
    lost &= where[:, 0] <= ndtri(step["share"])
    # The rim of a board and the end of a rod go with their sides, which are all that they touch
    touched = np.isin(np.arange(len(mesh.positions)), mesh.faces[lost])
    kept = ~(lost | touched[mesh.faces].all(axis=1))
    if not kept.any():
        raise UserError(f"thin: expected parts thicker than {step['thickness']:g} bounding radii, got none; lower "
                        "thickness or share")
    rest = TriangleMesh(positions=mesh.positions, faces=mesh.faces[kept], uvs=mesh.uvs[kept],
                        material=mesh.material[kept], colors=None if mesh.colors is None else mesh.colors[kept])
    return RoughBase(mesh=rest, creases=made.creases)


def _close_holes(made: RoughBase, step: RoughStep, setting: StepSetting) -> RoughBase:
    return RoughBase(mesh=without_holes(made.mesh, step["radius"] * setting.radius), creases=made.creases)


def _with_creases(mesh: TriangleMesh, setting: StepSetting) -> RoughBase:
    edges = edges_of(mesh.faces)
    return RoughBase(mesh=mesh, creases=edges.vertices[crease_mask(mesh, edges, crease_angle=setting.crease_angle)])


STEPS: dict[str, Callable[[RoughBase, RoughStep, StepSetting], RoughBase]] = {
    "white": _white, "field": _field, "scanlines": _scanlines, "bumps": _bumps, "smooth": _smooth,
    "decimate": _decimate, "voxels": _voxels, "thin": _thin, "close_holes": _close_holes,
}
