"""Meshes of an object as pictures, all from one place: shaded in grey, or coloured by a number at every corner."""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.rendering.scene.triangle_soup import Soup
from dataset_builder.report.looking.off_screen import plotter

if TYPE_CHECKING:
    from pyvista import Camera, PolyData

FINER = 2
"""A picture is drawn this many times larger, and averaged."""
CLAY = (0.80, 0.79, 0.77)
MARGIN = 1.04
"""Half of the frame, in radii of what is looked at."""
NEAREST = 2.5
"""Distance in radii of what is looked at that the camera is moved back to, if it is nearer."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Eye:
    """What all pictures of an object are drawn by: they may be compared."""

    position: np.ndarray
    """(3,) where the camera is."""
    middle: np.ndarray
    """(3,) what it looks at."""
    up: np.ndarray
    """(3,) which way is up in the picture."""
    radius: float
    """Of the sphere about `middle` that is seen whole."""

    @classmethod
    def of(cls, camera: Pinhole, soups: Sequence[Soup]) -> Self:
        """From the place of a camera, or from that direction where it is too near, to all of some meshes."""
        points = np.concatenate([soup.corners.reshape(-1, 3) for soup in soups])
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        radius = float(np.linalg.norm(points - middle, axis=1).max())
        way = camera.position - middle
        position = middle + way * max(1.0, NEAREST * radius / float(np.linalg.norm(way)))
        return cls(position=position, middle=middle, up=camera.up, radius=radius)

    def aim(self, drawn: "Camera") -> None:
        """Give PyVista's camera this place and view."""
        distance = float(np.linalg.norm(self.position - self.middle))
        drawn.focal_point, drawn.position, drawn.up = tuple(self.middle), tuple(self.position), tuple(self.up)
        drawn.view_angle = float(np.degrees(2 * np.arcsin(self.radius * MARGIN / distance)))
        drawn.clipping_range = (distance - 1.5 * self.radius, distance + 1.5 * self.radius)


def mesh_panel(soup: Soup, eye: Eye, size: int, values: np.ndarray | None = None,
               colours: np.ndarray | None = None) -> np.ndarray:
    """(size, size, 3) uint8 picture of a mesh in the world.

    values: (F, 3) in [0, 1] at the corners, shown by `colours`, (K, 3) uint8 from 0 to 1 and without shading; the mesh
    is grey and shaded without them.
    """
    from pyvista import LookupTable

    surface = _surface(soup)
    with closing(plotter(FINER * size, FINER * size)) as drawn:
        if values is None or colours is None:
            drawn.add_mesh(surface, color=CLAY, ambient=0.15, diffuse=0.85, specular=0.1)
        else:
            surface.point_data["value"] = np.clip(values, 0, 1).ravel()
            table = LookupTable(values=np.column_stack([colours, np.full(len(colours), 255, np.uint8)]),
                                scalar_range=(0, 1))
            drawn.add_mesh(surface, scalars="value", cmap=table, lighting=False, show_scalar_bar=False,
                           interpolate_before_map=True)
        eye.aim(drawn.camera)
        large = np.asarray(drawn.screenshot(return_img=True))[..., :3]
    return np.rint(large.reshape(size, FINER, size, FINER, 3).mean(axis=(1, 3))).astype(np.uint8)


def _surface(soup: Soup) -> "PolyData":
    """Triangles with corners of their own, so that normals and values may break at edges."""
    from pyvista import PolyData

    count = len(soup.corners)
    faces = np.column_stack([np.full(count, 3), np.arange(3 * count).reshape(-1, 3)])
    made = PolyData(soup.corners.reshape(-1, 3).astype(np.float32), faces.ravel())
    made.point_data.active_normals = soup.normals.reshape(-1, 3)
    return made
