"""Cameras of USD stages, worked out by hand."""

from math import atan, degrees
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom

from dataset_builder.assets.scene_readers.usd_cameras import FoundCamera, read_camera
from dataset_builder.errors import UserError

STAGE = Path("room.usda")
STAGES: list[Usd.Stage] = []
Z_FROM_Y = np.array([[1.0, 0, 0, 5], [0, 0, -1, 6], [0, 1, 0, 7], [0, 0, 0, 1]])


def found(world: np.ndarray = Z_FROM_Y, **attributes: Any) -> FoundCamera:
    STAGES.append(stage := Usd.Stage.CreateInMemory())
    camera = UsdGeom.Camera.Define(stage, "/Cam")
    for name, value in attributes.items():
        getattr(camera, f"Get{name}Attr")().Set(value)
    return read_camera(STAGE, camera.GetPrim(), world)


def test_a_camera_looks_along_minus_z_with_y_up() -> None:
    camera = found(Z_FROM_Y @ np.diag([2, 3, 4, 1.0])).camera
    assert camera is not None and camera.name == "/Cam" and camera.position == (5, 6, 7)
    assert camera.target == pytest.approx((5, 7, 7)) and camera.up == pytest.approx((0, 0, 1))


def test_the_field_of_view_is_that_of_aperture_and_focal_length() -> None:
    camera, plain = found(HorizontalAperture=36.0, FocalLength=18.0).camera, found()
    assert camera is not None and camera.fov == pytest.approx(90)
    assert plain.camera is not None and plain.camera.fov == pytest.approx(degrees(2 * atan(20.955 / 100)))
    assert plain.said == ()


@pytest.mark.parametrize(("attributes", "said"), [
    ({"HorizontalApertureOffset": 2.0}, "aperture offsets 2 and 0"), ({"FStop": 2.8}, "depth of field (fStop 2.8)"),
    ({"ClippingRange": Gf.Vec2f(0.5, 10)}, "clipping range 0.5 to 10"), ({"Exposure": 1.0}, "exposure"),
    ({"ClippingPlanes": [Gf.Vec4f(0, 0, 1, 1)]}, "clipping planes"), ({"StereoRole": "left"}, "stereo role"),
    ({"ShutterOpen": -0.25}, "shutter and motion blur"), ({"VerticalAperture": 20.0}, "verticalAperture; images")])
def test_what_a_pinhole_has_not_is_said(attributes: dict[str, Any], said: str) -> None:
    [line] = found(**attributes).said
    assert line.startswith(f"camera /Cam: {said}")


def test_orthographic_cameras_are_left_out() -> None:
    assert found(Projection="orthographic") == FoundCamera(camera=None,
                                                           said=("camera /Cam left out: orthographic",))


@pytest.mark.parametrize("attributes", [
    {"FocalLength": 0.0}, {"FocalLength": float("nan")}, {"HorizontalAperture": -1.0}, {"HorizontalAperture": 1e30},
    {"world": np.full((4, 4), np.inf)}, {"world": np.diag([1.0, 1.0, 0.0, 1.0])},
    {"world": Z_FROM_Y + np.outer((1, 0, 0, 0), (0, 0, 0, 1e30))}])
def test_numbers_that_no_camera_has_are_refused_by_file_and_prim(attributes: dict[str, Any]) -> None:
    with pytest.raises(UserError, match=r"room\.usda: /Cam: expected "):
        found(**attributes)
