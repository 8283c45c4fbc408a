"""What `import capture` made, to look at: photographs, what the field shows from the same cameras, and the mesh."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from dataset_builder.assets.field_file import FieldFile
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.report.example_sheet import SheetRow, write_sheet
from dataset_builder.tonemap import to_8bit

VIEWS = 6
"""Cameras that are shown, evenly chosen."""
BEHIND = 0.25
"""Linear grey behind objects."""
LIT = np.array([-0.4, -0.6, 0.7])
"""Direction to the light that the mesh is drawn in, in the object's frame."""
Shown = Callable[[FieldFile, PosedImages], np.ndarray]
"""(N, H, W, 4) premultiplied radiance and opacity that a field shows from cameras."""


def write_capture_sheet(content: FieldFile, images: PosedImages, target: Path, *, shown: Shown) -> None:
    """Write the sheet as a PNG file. images: that the field was fitted to, in its frame. Raises OutputError."""
    few = images.only(np.unique(np.linspace(0, len(images.pixels) - 1, VIEWS).astype(int)))
    field, scene = shown(content, few), RayScene([(content.mesh.positions, content.mesh.faces, 1)])
    rows = []
    for number in range(len(few.pixels)):
        photograph = np.asarray(few.pixels[number], np.float32)
        panels = {"photograph": _picture(photograph, content.white), "field": _picture(field[number], content.white),
                  "mesh": _mesh(scene, few, number)}
        rows.append(SheetRow(lines=[few.names[number][-28:] if few.names else str(number)], panels=panels))
    write_sheet(rows, target)


def _picture(rgba: np.ndarray, white: float) -> np.ndarray:
    return to_8bit(rgba[..., :3] / white + (1 - rgba[..., 3:]) * BEHIND)


def _mesh(scene: RayScene, images: PosedImages, number: int) -> np.ndarray:
    """(H, W, 3) uint8 of the mesh without its colours, which would hide its shape."""
    height, width = images.pixels.shape[1:3]
    rows, columns = np.divmod(np.arange(height * width), width)
    origins, ways = images.rays(number, columns + 0.5, rows + 0.5)
    normals = scene.normals(origins, ways)
    shade = np.where(normals.any(axis=1), 0.1 + 0.4 * (1 + normals @ (LIT / np.linalg.norm(LIT))), BEHIND)
    return to_8bit(shade.reshape(height, width, 1))
