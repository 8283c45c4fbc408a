"""UsdGeomCamera -> SceneCamera: https://openusd.org/release/api/class_usd_geom_camera.html"""

from dataclasses import dataclass
from math import atan, degrees, isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.assets.file_model import refuse
from dataset_builder.assets.light_bounds import MOST_METRES, bounded
from dataset_builder.assets.scene_model import SceneCamera
from dataset_builder.assets.scene_readers.usd_light_frames import vector

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom

FOVS = (0.1, 179.0)
"""Degrees across that a pinhole may see."""


@dataclass(frozen=True, kw_only=True)
class FoundCamera:
    """What became of one camera of a stage."""

    camera: SceneCamera | None
    """None where it is left out; `said` tells why."""
    said: tuple[str, ...]
    """What is not honoured, in words that name the prim."""


def read_camera(path: Path, prim: "Usd.Prim", world: np.ndarray) -> FoundCamera:
    """The camera of a prim at its first time: it looks along its -z, its +y is up.

    path: of the stage, for messages. world: (4, 4) to metres, Z up, from the prim's own axes. Raises UserError, with
    file and prim, for numbers that no camera has.
    """
    from pxr import Usd, UsdGeom

    name, camera, first = str(prim.GetPath()), UsdGeom.Camera(prim), Usd.TimeCode.EarliestTime()
    if camera.GetProjectionAttr().Get(first) == UsdGeom.Tokens.orthographic:
        return FoundCamera(camera=None, said=(f"camera {name} left out: orthographic",))
    if not np.isfinite(world).all():
        refuse(path, "expected a transform of finite numbers, got others", at=name)
    forward, up = -world[:3, 2], world[:3, 1]
    length = float(np.linalg.norm(forward))
    if length == 0 or float(np.linalg.norm(np.cross(forward, up))) <= 1e-9 * length * float(np.linalg.norm(up)):
        refuse(path, "expected a transform that keeps y and z apart, got one that flattens them", at=name)
    for value in world[:3, 3]:
        bounded(path, name, "place in metres", float(value), low=-MOST_METRES, high=MOST_METRES)
    fov = _fov(path, name, camera)
    forward = forward / length
    right = np.cross(forward, up)
    up = np.cross(right / np.linalg.norm(right), forward)
    found = SceneCamera(name=name, position=vector(world[:3, 3]), target=vector(world[:3, 3] + forward), up=vector(up),
                        fov=fov)
    said = [*_unread(camera), *(["mirroring"] if np.linalg.det(world[:3, :3]) < 0 else [])]
    return FoundCamera(camera=found, said=tuple(f"camera {name}: {what}" for what in said))


def _fov(path: Path, name: str, camera: "UsdGeom.Camera") -> float:
    """Horizontal field of view, degrees; aperture and focal length have one unit, whichever it is."""
    from pxr import Usd

    first = Usd.TimeCode.EarliestTime()
    aperture, focal = (attribute.Get(first) for attribute in (camera.GetHorizontalApertureAttr(),
                                                              camera.GetFocalLengthAttr()))
    aperture, focal = (float(value) if value is not None else np.nan for value in (aperture, focal))
    if not (isfinite(aperture) and isfinite(focal) and aperture > 0 and focal > 0):
        refuse(path, f"expected horizontalAperture and focalLength above 0, got {aperture:g} and {focal:g}", at=name)
    fov = degrees(2 * atan(aperture / (2 * focal)))
    return bounded(path, name, "the field of view, from horizontalAperture and focalLength,", fov, low=FOVS[0],
                   high=FOVS[1])


def _unread(camera: "UsdGeom.Camera") -> list[str]:
    """What a camera says besides and a pinhole in a frame of any aspect cannot do."""
    from pxr import Usd

    first = Usd.TimeCode.EarliestTime()

    def number(attribute: "Usd.Attribute") -> float:
        value = attribute.Get(first)
        return 0.0 if value is None else float(value)

    said = []
    offsets = number(camera.GetHorizontalApertureOffsetAttr()), number(camera.GetVerticalApertureOffsetAttr())
    if any(offsets):
        said.append(f"aperture offsets {offsets[0]:g} and {offsets[1]:g}")
    if number(camera.GetFStopAttr()) > 0:
        said.append(f"depth of field (fStop {number(camera.GetFStopAttr()):g})")
    if camera.GetClippingRangeAttr().IsAuthored():
        near, far = camera.GetClippingRangeAttr().Get(first)
        said.append(f"clipping range {near:g} to {far:g}")
    if camera.GetClippingPlanesAttr().Get(first):
        said.append("clipping planes")
    if number(camera.GetExposureAttr()) or camera.GetPrim().GetAttribute("exposure:iso").IsAuthored():
        said.append("exposure")
    if camera.GetShutterOpenAttr().IsAuthored() and number(camera.GetShutterOpenAttr()) != number(
            camera.GetShutterCloseAttr()):
        said.append("shutter and motion blur")
    if camera.GetStereoRoleAttr().Get(first) not in (None, "mono"):
        said.append("stereo role")
    if camera.GetVerticalApertureAttr().IsAuthored():
        said.append("verticalAperture; images have the aspect of the dataset")
    return said
