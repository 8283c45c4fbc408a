"""Changes to materials: drawn each from its own path, applied to the materials that they mean, refused by name."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.errors import PlanError
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.planning.scene.contents import contents
from dataset_builder.planning.scene.material_changes import changed, drawn_changes, matches
from dataset_builder.spec.loaded import LoadedSpec
from dataset_builder.spec.scene import MaterialSpec, ObjectSpec

Load = Callable[..., LoadedSpec]
TEXTURE = Texture(base_color=np.ones((1, 1, 3), np.float32))
OAK = Material(name="top: oak", base_color=(1, 1, 1), texture=TEXTURE)
STEEL = Material(name="frame: steel", base_color=(0.5, 0.5, 0.5), metallic=1.0)


def drawn(seed: int = 0, **spec: dict[str, Any]) -> tuple:  # type: ignore[type-arg]
    return drawn_changes({name: MaterialSpec.model_validate(change) for name, change in spec.items()}, seed, ("here",))


def values(changes: tuple, name: str) -> dict[str, float]:  # type: ignore[type-arg]
    return {param.name: param.value for change in changes if change.name == name for param in change.values}


def test_what_is_left_out_stays() -> None:
    made, = changed([OAK], drawn(top={"roughness": 0.25}), "table")
    assert made == replace(OAK, roughness=0.25) or (made.roughness, made.texture, made.base_color) == (
        0.25, TEXTURE, (1, 1, 1))


def test_colours_truths_and_textures() -> None:
    change = {"base_color": [0.1, 0.2, 0.3], "thin": True, "transmission": 1, "plain": True, "sheen": [0, 0.5, 1]}
    made, steel = changed([OAK, STEEL], drawn(top=change), "table")
    assert (made.base_color, made.thin, made.transmission, made.texture) == ((0.1, 0.2, 0.3), True, 1, None)
    assert made.sheen == (0, 0.5, 1) and steel is STEEL
    assert changed([made], drawn(top={"thin": False}), "table")[0].thin is False


def test_an_index_of_refraction_brings_its_reflectance() -> None:
    assert values(drawn(top={"ior": 1.5}), "top")["specular"] == pytest.approx(0.04)
    assert values(drawn(top={"ior": 1.0}), "top")["specular"] == 0
    assert values(drawn(top={"ior": 1.5, "specular": 0.1}), "top")["specular"] == 0.1


def test_each_number_has_its_own_draw() -> None:
    spread = {"uniform": [0, 1]}
    both = values(drawn(top={"roughness": spread, "base_color": [spread] * 3}), "top")
    alone = values(drawn(top={"roughness": spread}), "top")
    other = values(drawn(frame={"roughness": spread}), "frame")
    assert both["roughness"] == alone["roughness"] != other["roughness"]
    assert len(set(both.values())) == 4
    assert values(drawn(1, top={"roughness": spread}), "top") != alone


def test_names_roles_and_patterns() -> None:
    assert all(matches(name, "top: oak") for name in ("top", "top: oak", "*", "top: *", "*: oak"))
    assert not any(matches(name, "top: oak") for name in ("oak", "to", "Top", "frame"))
    both = changed([OAK, STEEL], drawn(**{"*": {"roughness": 0.3}, "frame": {"roughness": 0.6}}), "table")
    assert [made.roughness for made in both] == [0.3, 0.6]


def test_a_name_that_a_mesh_does_not_have_is_refused_with_those_it_has() -> None:
    with pytest.raises(PlanError, match=r"table: materials.tip: .*got 'tip'.*nearest known name: top"):
        changed([replace(OAK, name="top"), STEEL], drawn(tip={"roughness": 1}), "table")
    with pytest.raises(PlanError, match=r"materials\.glass_"):
        changed([OAK], drawn(**{"glass_*": {"roughness": 1}}), "table")


def test_what_another_draw_of_a_family_has_is_no_mistake() -> None:
    roles = ("frame", "top", "books")
    assert changed([OAK], drawn(books={"roughness": 1}, **{"*: pine": {"roughness": 1}}), "table", roles) == (OAK,)


def _chair(load: Load, **materials: Any) -> LoadedSpec:
    spec = ObjectSpec(family="chair", materials={name: MaterialSpec.model_validate(change)
                                                 for name, change in materials.items()})
    return load(objects={"chair.yaml": spec})


def test_a_role_that_a_family_never_has_is_refused_before_anything_is_made(load: Load) -> None:
    with pytest.raises(PlanError, match=r"chair.yaml: materials.leg: .*frame, cover"):
        contents(_chair(load, leg={"roughness": 1}))


def test_plans_hold_the_draws_and_assets_follow_them(load: Load) -> None:
    loaded = _chair(load, **{"*": {"roughness": {"uniform": [0.2, 0.8]}}})
    first, second = (contents(loaded)["train"].objects[k] for k in (0, 2))
    assert values(first.materials, "*") != values(second.materials, "*")
    asset = asset_of(first, Path())
    assert asset.materials[0].roughness == values(first.materials, "*")["roughness"]
    plain = contents(load())["train"].objects[0]
    assert first.params == plain.params and first.seed == plain.seed and plain.materials == ()
