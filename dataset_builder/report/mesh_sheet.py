"""The meshes of an example as one picture: the 3DM, the R3DM of every noise level, and how far they are apart."""

from pathlib import Path

import numpy as np
from PIL import Image

from dataset_builder.files import write_atomic
from dataset_builder.report.example_sheet import png_of
from dataset_builder.report.looking.level_meshes import LevelMesh, ViewMeshes
from dataset_builder.report.looking.mesh_panels import Eye, mesh_panel
from dataset_builder.report.picture_tiles import ColourBar, Tile, tiled

PANEL = 420
"""Width and height of a picture."""
HEAT = ((217, 217, 217), (254, 217, 118), (253, 141, 60), (227, 26, 28), (103, 0, 31))
"""Grey is where nothing moved."""
FULL = 99.0
"""Percentile of the roughest level's distances that the last colour stands for."""
LEAST = 1e-4
"""Radii: the last colour stands for this much at least, so that rounding has no colour."""
MILLIMETRES = 1000


def write_mesh_sheet(meshes: ViewMeshes, target: Path) -> None:
    """Write the picture as a PNG file, whole or not at all. Raises OutputError."""
    write_atomic(target, png_of(np.asarray(mesh_sheet(meshes))))


def mesh_sheet(meshes: ViewMeshes) -> Image.Image:
    """The picture: the 3DM and every R3DM above, the distances below in colours that all levels share."""
    plan, levels = meshes.own.plan, meshes.levels
    object_name, eye = plan.target.object.name, eye_of(meshes)
    title = [f"{object_name}, example {plan.key}, view {plan.view} under light {plan.light}: the meshes",
             f"bounding radius {meshes.radius * MILLIMETRES:.4g} mm; all from the direction of the example's camera"]
    shaded = [Tile(title=level.title, pixels=mesh_panel(level.rough, eye, PANEL), lines=_lines(level, meshes.radius))
              for level in levels]
    if meshes.clean is None:
        return tiled([*title, *meshes.missing], [shaded])
    full = heat_limit(levels)
    bar = ColourBar(colours=heat_colours(), scales=[(0, full * meshes.radius * MILLIMETRES, "mm"), (0, full, "radii")])
    explained = Tile(title="distance R3DM to 3DM", pixels=None, bar=bar, lines=(
        "Of every vertex of the R3DM from the nearest point of the 3DM. The last colour stands for all beyond, too.",
        *meshes.missing))
    heat = [Tile(title=f"{level.title}: distance", pixels=heat_panel(level, eye, full)) for level in levels]
    clean = Tile(title="3DM", pixels=mesh_panel(meshes.clean, eye, PANEL),
                 lines=(f"{len(meshes.clean.corners):,} triangles",))
    return tiled(title, [[clean, *shaded], [explained, *heat]])


def eye_of(meshes: ViewMeshes) -> Eye:
    """The one place that all meshes are seen from."""
    return Eye.of(meshes.camera, [*(level.rough for level in meshes.levels), *filter(None, [meshes.clean])])


def heat_limit(levels: tuple[LevelMesh, ...]) -> float:
    """The distance in radii that the last colour stands for."""
    known = [level.distance for level in levels if level.distance is not None]
    return max([LEAST, *(float(np.percentile(distance, FULL)) for distance in known)])


def heat_panel(level: LevelMesh, eye: Eye, full: float) -> np.ndarray | None:
    """(PANEL, PANEL, 3) uint8 picture of a level's distances from 0 to `full` radii; None where there are none."""
    if level.distance is None:
        return None
    return mesh_panel(level.rough, eye, PANEL, level.distance / full, heat_colours())


def heat_colours(count: int = 256) -> np.ndarray:
    """(count, 3) uint8 colours of distances, from none on."""
    place = np.linspace(0, len(HEAT) - 1, count)
    return np.rint(np.stack([np.interp(place, range(len(HEAT)), channel) for channel in zip(*HEAT, strict=True)],
                            axis=1)).astype(np.uint8)


def _lines(level: LevelMesh, radius: float) -> list[str]:
    """What is told of a level below its picture."""
    plan = level.label.plan
    told = [f"example {plan.key}, {len(level.rough.corners):,} triangles",
            plan.rough.field.kind + " field" if plan.rough.field.there else f"sigma {plan.rough.sigma:.4g} radii"]
    if level.distance is not None:
        told += [f"{what} {value * radius * MILLIMETRES:.3g} mm, {value:.3g} radii"
                 for what, value in (("rms", level.rms), ("largest", level.maximum))]
    if level.differs:
        record = level.label.record
        told.append(f"not the mesh that was rendered: its label has rms {record.roughness_rms:.3g} and largest "
                    f"{record.roughness_max:.3g} radii; other versions or files made it")
    return told
