"""Where a UsdLux light stands and how it is turned, in the conventions of our lights."""

from dataclasses import dataclass
from math import atan2, degrees
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.assets.file_model import refuse
from dataset_builder.geometry.light_axes import rectangle_axes
from dataset_builder.label.scene_plan import Vector

if TYPE_CHECKING:
    from dataset_builder.assets.scene_readers.usd_light_values import LightInputs

UNEVEN = 0.01
"""Difference of two scales over the larger, or cosine between axes that should be square, from which it is said."""
TILTED = 0.1
"""Degrees of a dome's pole from the vertical from which it is said."""


def vector(array: np.ndarray) -> Vector:
    """Three floats of an array (3,)."""
    x, y, z = (float(value) for value in array)
    return x, y, z


@dataclass(frozen=True, kw_only=True, eq=False)
class LightFrame:
    """A light's own axes in the world."""

    position: Vector
    """Metres."""
    axes: tuple[np.ndarray, np.ndarray, np.ndarray]
    """Its x, y and z, each (3,), as long as the world's metres that they are."""
    down: Vector
    """Unit vector that its light leaves along: its -z, square to x and y."""
    unit: float
    """Metres of the stage's unit, in which areas are that brightness is divided by."""

    def say_uneven(self, inputs: "LightInputs", scales: tuple[float, ...], what: str) -> None:
        """Say `what` it is where the scales differ."""
        if max(scales) - min(scales) > UNEVEN * max(scales):
            inputs.say(f"scale {' '.join(f'{scale:g}' for scale in scales)}; {what}")

    def say_sheared(self, inputs: "LightInputs") -> None:
        """Say where x and y are not square to each other."""
        x, y, _ = self.axes
        if abs(float(x @ y)) > UNEVEN * float(np.linalg.norm(x) * np.linalg.norm(y)):
            inputs.say("shear; a rectangle of its width and height is taken")


def frame_of(path: Path, at: str, world: np.ndarray, unit: float) -> LightFrame:
    """The frame of a light whose own axes the (4, 4) matrix takes to the world, metres; unit: those of the stage's.

    Raises UserError for a matrix that is not finite or flattens its x and y.
    """
    if not np.isfinite(world).all():
        refuse(path, "expected a transform of finite numbers, got others", at=at)
    x, y, z = (np.asarray(world[:3, k], dtype=np.float64) for k in range(3))
    normal = np.cross(x, y)
    lengths = [float(np.linalg.norm(axis)) for axis in (x, y, z, normal)]
    if min(lengths[:2]) == 0 or lengths[3] <= 1e-9 * lengths[0] * lengths[1]:
        refuse(path, "expected a transform that keeps x and y apart, got one that flattens them", at=at)
    normal /= lengths[3]
    away = normal if normal @ z < 0 else -normal
    return LightFrame(position=vector(world[:3, 3]), axes=(x, y, z), down=vector(away), unit=unit)


def rectangle_turn(frame: LightFrame) -> float:
    """Degrees that a rectangle is turned about its direction so that its first side lies along the frame's -x, which is
    to the right for who sees it shine with its y upwards."""
    right, above = rectangle_axes(frame.down, 0.0)
    x = -frame.axes[0]
    return degrees(atan2(float(x @ above), float(x @ right)))


def dome_turn(inputs: "LightInputs", frame: LightFrame) -> float:
    """Degrees that the middle column of a dome's image is turned about +Z, from +X.

    OpenEXR's images have their pole along +y and their middle along +z of the light. Those of DomeLight_1 may have it
    along +z, and then their middle along -y.
    """
    pole_axis = str(inputs.value("poleAxis", "Y"))
    if pole_axis == "scene":
        from pxr import UsdGeom

        pole_axis = str(UsdGeom.GetStageUpAxis(inputs.prim.GetStage()))
    x, y, z = frame.axes
    pole, middle = (z, -y) if pole_axis == "Z" else (y, z)
    tilt = degrees(atan2(float(np.hypot(*pole[:2])), float(pole[2])))
    if tilt > TILTED:
        inputs.say(f"tilt of {tilt:.3g} degrees; the image is shown upright")
    if np.linalg.det(np.stack([x, y, z])) < 0:
        inputs.say("a mirrored image; it is shown unmirrored")
    return degrees(atan2(float(middle[1]), float(middle[0])))
