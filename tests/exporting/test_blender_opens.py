"""What Blender's own importer makes of an exported stage."""

import importlib.util
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.cycles.stage_client import StageViewer
from benchmarks.cycles.units import power
from dataset_builder.exporting.export_usd import Exported
from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.label.scene_plan import LightPlan
from dataset_builder.rendering.scene.triangle_soup import clean, rough_twin, surroundings

PYTHON = os.environ.get("BPY_PYTHON") or (sys.executable if importlib.util.find_spec("bpy") else "")
pytestmark = pytest.mark.skipif(not PYTHON, reason="no bpy here, and BPY_PYTHON names no environment with it")
TYPES = {"area": "AREA", "sphere": "POINT", "point": "POINT", "spot": "SPOT", "sun": "SUN", "disk": "AREA"}


@pytest.fixture(scope="module")
def viewer() -> Iterator[StageViewer]:
    """Blender, started once."""
    with StageViewer(Path(PYTHON), threads=1) as blender:
        yield blender


def opened(viewer: StageViewer, exported: Exported, label: ExampleLabel, illumination: str, geometry: str) \
        -> dict[str, Any]:
    render = label.plan.render
    return viewer.open(exported.stage, illumination=illumination, geometry=geometry, width=render.width,
                       height=render.height, bounces=2)


@pytest.mark.parametrize("geometry", ["3DM", "R3DM"])
def test_meshes_stand_where_ours_do(viewer: StageViewer, exported: Exported, label: ExampleLabel, small_spec: Path,
                                    geometry: str) -> None:
    found = opened(viewer, exported, label, "target", geometry)["meshes"]
    plan, root = label.plan, small_spec.parent
    target = clean(plan.target, root) if geometry == "3DM" else rough_twin(plan.target, plan.rough, root).soup
    around = surroundings(plan, root)
    stool, = plan.furniture
    ours = {"Target_mesh": target, "floor_mesh": around.only(around.part == 1),
            "walls_mesh": around.only(around.part == 2), "ceiling_mesh": around.only(around.part == 3),
            "train_scene00_stool_00_mesh": around.only(around.instance == stool.instance)}
    assert {name: mesh["faces"] for name, mesh in found.items()} == {name: len(s.corners) for name, s in ours.items()}
    for name, soup in ours.items():
        points = soup.corners.reshape(-1, 3)
        np.testing.assert_allclose(found[name]["low"], points.min(axis=0), atol=1e-5, err_msg=name)
        np.testing.assert_allclose(found[name]["high"], points.max(axis=0), atol=1e-5, err_msg=name)


def test_the_camera_sees_what_ours_does(viewer: StageViewer, exported: Exported, label: ExampleLabel) -> None:
    found, plan = opened(viewer, exported, label, "target", "3DM")["camera"], label.plan.camera
    ahead = np.subtract(plan.target, plan.position)
    assert found["fov"] == pytest.approx(plan.fov, rel=1e-5)
    np.testing.assert_allclose(found["position"], plan.position, atol=1e-5)
    np.testing.assert_allclose(found["direction"], ahead / np.linalg.norm(ahead), atol=1e-5)
    assert np.dot(found["up"], (0, 0, 1)) > 0


@pytest.mark.parametrize("illumination", ["source", "target"])
def test_lights_send_what_ours_do(viewer: StageViewer, exported: Exported, label: ExampleLabel,
                                  illumination: str) -> None:
    """In watts of the largest channel; what is opened for the source light is gone."""
    found, plan = opened(viewer, exported, label, illumination, "3DM"), label.plan
    lights = plan.source_light.lights if illumination == "source" else plan.target_light.lights
    dome, = (light for light in lights if light.kind == "dome")
    np.testing.assert_allclose(found["world"], dome.radiance, rtol=1e-6)
    lamps = {f"{light.kind}_{number}": light for number, light in enumerate(lights) if light.kind != "dome"}
    assert set(found["lights"]) == set(lamps)
    for name, light in lamps.items():
        _require_alike(found["lights"][name], light)
    assert ("walls_mesh" in found["meshes"]) == (illumination == "target")


def _require_alike(found: dict[str, Any], light: LightPlan) -> None:
    assert found["type"] == TYPES[light.kind]
    np.testing.assert_allclose(found["position"], light.position, atol=1e-5)
    assert found["energy"] == pytest.approx(power(light.kind, max(light.radiance), light.size), rel=1e-5)
    np.testing.assert_allclose(found["color"], np.divide(light.radiance, max(light.radiance)), atol=1e-6)
    if light.kind == "area":
        np.testing.assert_allclose(found["direction"], light.direction, atol=1e-5)


def test_blender_renders_it(viewer: StageViewer, exported: Exported, label: ExampleLabel) -> None:
    opened(viewer, exported, label, "target", "3DM")
    picture = viewer.picture(spp=4).passes["combined"]
    assert picture.shape == (20, 24, 3) and np.isfinite(picture).all() and picture.mean() > 0
