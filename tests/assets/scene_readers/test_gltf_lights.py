"""Lights and cameras of glTF scenes, by values worked out by hand."""

from math import degrees, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.errors import UserError
from tests.assets.gltf_files import GltfMaker
from tests.assets.gltf_scenes import add_mesh, box_asset, scene

DOWN = [-(0.5**0.5), 0, 0, 0.5**0.5]
"""A turn about x that brings -Z to -Y, which is down."""


def lit(light: dict[str, Any], **node: Any) -> GltfMaker:
    made = GltfMaker()
    made.add("nodes", name="box", mesh=add_mesh(made, box_asset((0, 0, 0), (1, 1, 1))))
    made.header["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    made.add("nodes", name="lamp", extensions={"KHR_lights_punctual": {"light": 0}}, **node)
    made.use("KHR_lights_punctual", required=True)
    return made


def test_a_sun(tmp_path: Path) -> None:
    found = scene(lit({"type": "directional", "intensity": 1366, "color": [1, 0.5, 0]}, rotation=DOWN), tmp_path)
    light = found.lights[0].light
    assert found.lights[0].name == "lamp" and light.kind == "sun" and light.weight == 0
    assert light.radiance == pytest.approx((2, 1, 0)) and light.direction == pytest.approx((0, 0, -1), abs=1e-12)
    assert "lights read at 683 lm/W" in found.left_out and "1 light" not in found.left_out


@pytest.mark.parametrize(("scale", "intensity"), [(1.0, 0.1), (0.1, 0.001)])
def test_a_point_in_metres_and_in_other_units(tmp_path: Path, scale: float, intensity: float) -> None:
    """The irradiance of what it lights stays the same: 100 times weaker at a tenth of the distance."""
    found = scene(lit({"type": "point", "intensity": 68.3, "range": 5}, translation=[1, 2, 3]), tmp_path, scale=scale)
    light = found.lights[0].light
    assert light.kind == "point" and light.radiance == pytest.approx((intensity,) * 3)
    assert light.position == pytest.approx((scale, -3 * scale, 2 * scale))
    assert "light lamp: its range, as light has none" in found.left_out


def test_a_spot(tmp_path: Path) -> None:
    spot = {"innerConeAngle": pi / 8, "outerConeAngle": pi / 4}
    found = scene(lit({"type": "spot", "intensity": 683, "spot": spot}), tmp_path)
    light = found.lights[0].light
    assert light.kind == "spot" and light.cutoff == pytest.approx(45) and light.radiance == pytest.approx((1, 1, 1))
    assert light.direction == pytest.approx((0, 1, 0))  # -Z of the file
    assert light.beam == pytest.approx(22.5)
    assert "light lamp: the smooth edge of its cone, which falls linearly here" in found.left_out
    wide = scene(lit({"type": "spot", "spot": {"outerConeAngle": pi / 2}}), tmp_path).lights[0].light
    assert wide.cutoff == 90 and 0 < wide.beam < 0.01


@pytest.mark.parametrize(("light", "rule"), [
    ({"type": "spot", "spot": {"innerConeAngle": 1, "outerConeAngle": 0.5}}, "expected 0 <= inner < outer <= 90"),
    ({"type": "spot", "spot": {"outerConeAngle": 0}}, "expected 0 <= inner < outer <= 90"),
    ({"type": "point", "intensity": 1e29}, "intensity: expected less than 1e\\+12, got 1e\\+29")])
def test_lights_that_cannot_be(tmp_path: Path, light: dict[str, Any], rule: str) -> None:
    with pytest.raises(UserError, match=rule):
        scene(lit(light), tmp_path)


def test_lights_of_unknown_types_and_of_hidden_nodes(tmp_path: Path) -> None:
    found = scene(lit({"type": "disco"}), tmp_path)
    assert found.lights == () and "light lamp: left out, being of a type 'disco' that is not known" in found.left_out
    made = lit({"type": "point"})
    made.header["nodes"][1]["extensions"]["KHR_node_visibility"] = {"visible": False}
    assert scene(made, tmp_path).lights == ()


def test_a_light_on_a_node_that_is_scaled_to_nothing(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="expected a node whose matrix keeps its axes"):
        scene(lit({"type": "directional"}, scale=[0, 0, 0]), tmp_path)


def with_camera(camera: dict[str, Any], **node: Any) -> GltfMaker:
    made = GltfMaker()
    made.add("nodes", name="box", mesh=add_mesh(made, box_asset((0, 0, 0), (1, 1, 1))))
    made.add("nodes", name="eye", camera=made.add("cameras", **camera), **node)
    return made


def test_a_camera(tmp_path: Path) -> None:
    """tan(fov / 2) is the aspect times tan(yfov / 2)."""
    lens = {"yfov": pi / 2, "aspectRatio": 2, "znear": 0.1}
    found = scene(with_camera({"type": "perspective", "perspective": lens}, translation=[0, 1, 5]), tmp_path)
    camera, = found.cameras
    assert camera.name == "eye" and camera.fov == pytest.approx(degrees(2 * np.arctan(2)))
    assert camera.position == pytest.approx((0, -5, 1)) and camera.up == pytest.approx((0, 0, 1))
    assert camera.target == pytest.approx((0, -4, 1))
    assert not any("camera" in note for note in found.left_out)


def test_cameras_that_leave_a_choice_or_are_none(tmp_path: Path) -> None:
    found = scene(with_camera({"type": "perspective", "perspective": {"yfov": 1}}), tmp_path)
    assert found.cameras[0].fov == pytest.approx(degrees(1))
    assert "camera eye: no aspectRatio, taken as square" in found.left_out
    found = scene(with_camera({"type": "orthographic", "orthographic": {}}), tmp_path)
    assert found.cameras == () and "1 camera without perspective" in found.left_out
    with pytest.raises(UserError, match=r"cameras\[0\].perspective: expected a yfov in \(0, pi\)"):
        scene(with_camera({"type": "perspective", "perspective": {}}), tmp_path)
