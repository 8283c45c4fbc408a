"""The folder that Blender reads holds what our renderer is given."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.cycles.client import Blender
from benchmarks.cycles.scene_file import Scene, scene_of, write
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.plan import plan_example
from dataset_builder.rendering.scene.triangle_soup import PARTS, clean, merge, surroundings
from dataset_builder.spec.load import load_dataset

BPY_PYTHON = os.environ.get("BPY_PYTHON", "")
"""Python of an environment with bpy, for the one test that needs it."""


@pytest.fixture(scope="module")
def plan(small_spec: Path) -> ExamplePlan:
    return plan_example(load_dataset(small_spec), 1)


@pytest.fixture(scope="module")
def scene(plan: ExamplePlan, small_spec: Path) -> Scene:
    return scene_of(plan, small_spec.parent)


@pytest.fixture(scope="module")
def folder(plan: ExamplePlan, scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("cycles") / "scene"
    write(plan, scene, made)
    return made


def rows(corners: np.ndarray, normals: np.ndarray, uvs: np.ndarray, names: list[str]) -> list[tuple[object, ...]]:
    """One sorted row per triangle."""
    values = np.concatenate([array.reshape(len(array), -1) for array in (corners, normals, uvs)], axis=1)
    return sorted((*row, name) for row, name in zip(values.tolist(), names, strict=True))


def test_every_triangle_keeps_its_place_and_material(plan: ExamplePlan, folder: Path, small_spec: Path) -> None:
    whole = merge([clean(plan.target, small_spec.parent), surroundings(plan, small_spec.parent)])
    names = [m["name"] for m in json.loads((folder / "scene.json").read_text())["materials"]]
    with np.load(folder / "meshes.npz") as arrays:
        parts = [{field: arrays[f"{name}/{field}"] for field in ("corners", "normals", "uvs", "material")}
                 for name in ("target", *PARTS)]
    found = {field: np.concatenate([part[field] for part in parts]) for field in parts[0]}
    assert rows(found["corners"], found["normals"], found["uvs"], [names[m] for m in found["material"]]) == rows(
        whole.corners, whole.normals, whole.uvs, [whole.materials[m].name for m in whole.material])


def test_texels_factors_and_limits_come_back(plan: ExamplePlan, scene: Scene, folder: Path) -> None:
    found = json.loads((folder / "scene.json").read_text())
    with np.load(folder / "textures.npz") as texels:
        for material, entry in zip(scene.materials, found["materials"], strict=True):
            assert tuple(entry["base_color"]) == material.base_color
            assert (entry["texture"] < 0) == (material.texture is None)
            if material.texture is not None:
                np.testing.assert_array_equal(texels[f"{entry['texture']}/base_color"], material.texture.base_color)
    assert found["open"] == list(plan.source_light.open)
    assert found["max_depth"]["rough"] == plan.effects.of("rough").max_depth
    assert [light["radiance"] for light in found["lights"]["target"]] == [list(light.radiance) for light in
                                                                          plan.target_light.lights]


def test_the_camera_looks_along_its_third_axis(plan: ExamplePlan, folder: Path) -> None:
    camera = json.loads((folder / "scene.json").read_text())["camera"]
    axes = np.array(camera["axes"])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    ahead = np.array(plan.camera.target) - np.array(camera["position"])
    assert np.dot(axes[2], ahead) == pytest.approx(np.linalg.norm(ahead))


def test_fog_is_refused(plan: ExamplePlan, small_spec: Path) -> None:
    foggy = plan.model_copy(update={"fog": plan.fog.model_copy(update={"extinction": 0.1})})
    with pytest.raises(ValueError, match=r"clear air.*extinction 0\.1"):
        scene_of(foggy, small_spec.parent)


def test_glass_and_coats_are_refused(plan: ExamplePlan, small_spec: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from benchmarks.cycles import scene_file

    soup = clean(plan.target, small_spec.parent)
    coated = replace(soup, materials=tuple(replace(m, name="lacquer", coat=0.5) for m in soup.materials))
    monkeypatch.setattr(scene_file, "clean", lambda placed, root: coated)
    with pytest.raises(ValueError, match="lacquer"):
        scene_of(plan, small_spec.parent)


@pytest.mark.skipif(not BPY_PYTHON, reason="BPY_PYTHON names no environment with bpy")
def test_blender_renders_the_folder(folder: Path) -> None:
    with Blender(Path(BPY_PYTHON), threads=1) as blender:
        blender.load(folder)
        blender.show("rough", bounces=1)
        whole = blender.render(spp=1, seed=1, passes=("diffuse_direct", "diffuse_color")).passes
        part = blender.render(spp=1, seed=1, denoise="shading", window=(4, 5, 16, 15)).passes
    assert {"combined", "diffuse_direct", "diffuse_color"} <= set(whole)
    assert all(image.shape == (20, 24, 3) and np.isfinite(image).all() for image in whole.values())
    assert whole["combined"].mean() > 0 and 0 < whole["diffuse_color"].mean() < 1
    assert part["combined"][5:15, 4:16].mean() > 0 and not part["combined"][:5].any()
    assert "composite" in part
