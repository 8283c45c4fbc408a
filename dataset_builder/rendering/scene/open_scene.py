"""Triangles, lights and a camera -> a Mitsuba scene of constant structure, one at a time.

Dr.Jit compiles a call of a method for every object that is alive, so the kernel of one scene is the kernel of the next
only if nothing of another scene is about: bodies are kept as bare arrays, and a scene lives as long as its pass.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

from dataset_builder.label.scene_plan import CameraPlan, IlluminationPlan, PortalPlan
from dataset_builder.planning.effects.caustics_told import gathers
from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.scene.emitters import emitters
from dataset_builder.rendering.scene.shapes import Triangles, mesh_of, upload
from dataset_builder.rendering.scene.triangle_soup import Soup
from dataset_builder.rendering.surface.bsdf import FEATURES, PLUGIN, Surface
from dataset_builder.rendering.surface.material_table import MaterialTable, Textures, VertexColours
from dataset_builder.rendering.transport.fog import Fog
from dataset_builder.rendering.transport.portals import Portals, portals_of

MOST_CASTERS = 16
"""Spheres that light paths are aimed at."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """Geometry and materials on the device."""

    triangles: Triangles
    materials: MaterialTable
    instance: mi.UInt32
    """Value in the `instance` layer of each face."""
    features: frozenset[str] | None = None
    """What its kernels can do, see `example_plan.Feature`; None is everything."""
    casters: np.ndarray
    """(K, 4) spheres about what gathers light, see `casters_of`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OpenScene:
    """A scene that can be traced, and the body in it."""

    scene: mi.Scene
    body: Body
    shape: mi.Mesh
    """What the body is in the scene."""
    illumination: IlluminationPlan | None = None
    """Its lights, in the frame of the scene; None for none."""
    fog: Fog | None = None
    """None for clear air."""
    portals: Portals | None = None
    """What samples of its dome go through; None where they go all round."""

    @property
    def features(self) -> frozenset[str]:
        """What its kernels can do."""
        return FEATURES if self.body.features is None else self.body.features


def body_of(soup: Soup, textures: Textures | None = None, features: frozenset[str] | None = None) -> Body:
    """Upload a soup; `textures` are its materials where they are on the device already. Raises PlanError for materials
    and colours that no surface can have."""
    casters = casters_of(soup)
    if not len(soup.corners):
        soup = _unseen(soup)
    triangles = upload(soup.corners, soup.normals, soup.uvs)
    vertices = VertexColours.of(soup.materials, soup.material, soup.colors, triangles.positions)
    return Body(triangles=triangles,
                materials=MaterialTable(textures=textures or Textures.upload(soup.materials),
                                        face_material=owned(mi.UInt32, soup.material.astype(np.uint32)),
                                        vertices=vertices),
                instance=owned(mi.UInt32, soup.instance.astype(np.uint32)), features=features,
                casters=casters)


def casters_of(soup: Soup) -> np.ndarray:
    """(K, 4) centre and radius of spheres about the faces whose material gathers light into caustics: one for each
    instance that has any, and of many only the `MOST_CASTERS` largest."""
    gathering = np.array([gathers(material) for material in soup.materials], dtype=bool)
    faces = gathering[soup.material] if gathering.any() else np.zeros(len(soup.material), dtype=bool)
    points, instance = soup.corners[faces].astype(np.float64), soup.instance[faces]
    each = [_sphere(points[instance == number].reshape(-1, 3)) for number in np.unique(instance)]
    spheres = np.array(each).reshape(-1, 4)
    return spheres[np.argsort(-spheres[:, 3], kind="stable")[:MOST_CASTERS]]


def _sphere(points: np.ndarray) -> np.ndarray:
    """(4,) centre of the box about points (N, 3), and their largest distance from it."""
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    return np.append(centre, np.linalg.norm(points - centre, axis=1).max())


def _unseen(soup: Soup) -> Soup:
    """A triangle without area, which no ray meets: kernels cannot look up anything in a scene without any."""
    return replace(soup, corners=np.zeros((1, 3, 3)), normals=np.tile([0.0, 0, 1], (1, 3, 1)), uvs=np.zeros((1, 3, 2)),
                   material=np.zeros(1), instance=np.zeros(1), part=np.zeros(1), colors=None)


@contextmanager
def open_scene(body: Body, illumination: IlluminationPlan | None, fog: Fog | None = None,
               image_root: Path | None = None, portals: Sequence[PortalPlan] = ()) -> Iterator[OpenScene]:
    """A scene of one body under an illumination, or without any light. Nothing of it may be kept.

    image_root: folder that images of lights are found below. portals: openings that light gets in through, in the
    frame of the body.

    Garbage is not collected meanwhile: an object that died during tracing would renumber those that are called.
    """
    lights = emitters(illumination, image_root) if illumination is not None else {}
    surface_plugin = _surface(mi.variant())
    surface_plugin.bind(body.materials, body.features)
    shape = mesh_of(body.triangles, surface_plugin)
    collecting = gc.isenabled()
    gc.disable()
    try:
        # Loading in parallel would number the objects anew each time.
        scene = mi.load_dict({"type": "scene", **_tight(), "body": shape, **lights}, parallel=False)
        yield OpenScene(scene=scene, body=body, shape=shape, illumination=illumination, fog=fog,
                        portals=portals_of(portals, illumination))
    finally:
        del lights
        if collecting:
            gc.enable()


def _tight() -> dict[str, Any]:
    """Rays that slip between neighbouring triangles are worth a little time; only Embree has the choice."""
    return {"embree_use_robust_intersections": True} if mi.variant().startswith("llvm") else {}


@cache
def _surface(variant: str) -> Surface:
    """The one surface of the process: it is bound to each body in turn."""
    return mi.load_dict({"type": PLUGIN})


def sensor_of(camera: CameraPlan, width: int, height: int) -> mi.Sensor:
    """A perspective sensor; film of width x height pixels with a box filter."""
    film = {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}, "pixel_format": "rgb",
            "component_format": "float32"}
    sensor: dict[str, Any] = {"type": "perspective", "fov": camera.fov, "fov_axis": "x", "film": film,
                              "near_clip": 1e-3, "far_clip": 1e7,
                              "to_world": mi.ScalarTransform4f().look_at(camera.position, camera.target, camera.up)}
    return mi.load_dict(sensor)
