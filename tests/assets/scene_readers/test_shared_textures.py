"""Equal textures of a scene become one; others stay apart, and assets that things share stay shared."""

from dataclasses import replace

import numpy as np
import pytest

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.assets.scene_file import load_scene
from dataset_builder.assets.scene_model import SceneThing
from dataset_builder.assets.scene_readers.shared_textures import sharing_textures
from dataset_builder.label.scene_source import SceneSource
from tests.assets.gltf_scenes import box_asset
from tests.assets.readers.wavefront_files import png

BOX = box_asset((0, 0, 0), (1, 1, 1))


def texture(*levels: float, **more) -> Texture:
    """Three rows; equal in the middle one."""
    rows = np.array([levels, [0.5] * len(levels), levels], np.float16)
    return Texture(base_color=np.repeat(rows[..., None], 3, axis=2), **more)


def things(*textures: Texture | None) -> list[SceneThing]:
    found = []
    for number, each in enumerate(textures):
        material = Material(name=f"paint {number}", base_color=(1, 1, 1), texture=each)
        found.append(SceneThing(name=f"box {number}", category="", role="object", world=np.eye(4), content="",
                                asset=replace(BOX, materials=(material,))))
    return found


def textures_of(things) -> list[Texture | None]:
    return [material.texture for thing in things for material in thing.asset.materials]


def test_equal_textures_become_the_first_of_them() -> None:
    first, second = texture(0.1, 0.2), texture(0.1, 0.2)
    before = things(first, None, second, first)
    after = sharing_textures(before)
    assert textures_of(after) == [first, None, first, first]
    assert [thing.asset is was.asset for thing, was in zip(after, before, strict=True)] == [True, True, False, True]
    assert after[2].asset.materials[0].name == "paint 2"


@pytest.mark.parametrize("other", [
    texture(0.1, 0.25), texture(0.1, 0.2, wrap=("clamp", "repeat")), texture(0.1, 0.2, nearest=True),
    texture(0.1, 0.2, alpha=np.ones((3, 2), np.float16)), texture(0.1, 0.2, 0.3)])
def test_others_stay_apart(other: Texture) -> None:
    first = texture(0.1, 0.2)
    assert textures_of(sharing_textures(things(first, other))) == [first, other]


def test_an_asset_of_several_things_stays_one() -> None:
    one, two = things(texture(0.1, 0.2), texture(0.1, 0.2))
    after = sharing_textures([one, two, replace(two, name="again")])
    assert after[1].asset is after[2].asset and after[1].asset is not two.asset


def test_a_scene_keeps_its_pictures_once_in_half_precision(tmp_path) -> None:
    levels = np.arange(256, dtype=np.uint8).reshape(16, 16)
    (tmp_path / "wood.png").write_bytes(png(np.repeat(levels[..., None], 3, axis=2)))
    (tmp_path / "a.mtl").write_text("".join(f"newmtl {name}\nKd 1 1 1\nmap_Kd wood.png\n" for name in "ab"))
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n" + "".join(
        f"o {name}\nusemtl {name}\nf 1/1 2/1 3/1\n" for name in "ab"))
    source = SceneSource(source="a.obj", source_sha256="", licence="CC0-1.0")
    first, second = textures_of(load_scene(source, tmp_path).things)
    assert first is second and first.base_color.dtype == np.float16
    # All levels of an sRGB image stay apart
    assert len(np.unique(first.base_color)) == 256
