"""What a scene calls for: features by its materials, and why."""

from dataclasses import replace
from typing import Any, get_args

import numpy as np
import pytest

from dataset_builder.assets.asset import Material, Texture, coverage_range, vertex_alphas
from dataset_builder.label.example_plan import Feature
from dataset_builder.label.scene_plan import FogPlan
from dataset_builder.planning.effects.features import scene_features
from dataset_builder.planning.effects.materials_used import MaterialUse, SceneUse
from dataset_builder.planning.scene import assets_of_plan
from tests import plans
from tests.planning.effects.decided import GLASS, MATTE, Decide, choices, reason


@pytest.mark.parametrize(("figures", "expected"), [
    ({}, ()),
    ({"specular": 0.04}, ("specular",)),
    ({"metallic": 1.0}, ("specular",)),
    ({"coat": 0.5}, ("specular", "coat")),
    ({"sheen.0": 0.0, "sheen.1": 0.2, "sheen.2": 0.0}, ("sheen",)),
    ({"transmission": 0.01}, ("specular", "glass")),
    ({"transmission": 1.0, "thin": 1.0}, ("specular", "thin")),
    ({"transmission": 1.0, "abbe": 40.0}, ("specular", "glass", "dispersion")),
    ({"transmission": 1.0, "abbe": 40.0, "thin": 1.0}, ("specular", "thin")),
    ({"abbe": 40.0}, ()),
    ({"transmission": 1.0, "metallic": 1.0}, ("specular",)),
    ({"alpha": 0.5}, ("coverage",)),
    ({"alpha": 1.0}, ()),
    ({"emission.0": 0.0, "emission.1": 0.5, "emission.2": 0.0}, ("emission",)),
    ({"emission.0": 0.0, "emission.1": 0.0, "emission.2": 0.0}, ()),
])
def test_features_follow_the_materials(decide: Decide, figures: dict[str, float], expected: tuple[str, ...]) -> None:
    """The room is of grey boxes with some gloss, so that `specular` is on in any case."""
    everywhere = {*expected, "specular"}
    for effects in (decide(MATTE | figures), decide(MATTE, (MATTE, MATTE | figures))):
        assert set(effects.features) == everywhere
        assert effects.features == tuple(name for name in get_args(Feature) if name in everywhere)
        for feature in ("coat", "sheen", "glass", "thin", "dispersion", "coverage", "emission", "fog"):
            found = [choice for choice in choices(effects, feature) if choice != "not honoured"]
            assert found == ["on" if feature in everywhere else "off"]


def test_reasons_name_what_calls_for_an_effect(decide: Decide) -> None:
    effects = decide(MATTE, (GLASS | {"abbe": 35.0},))
    assert "grey of box-3" in reason(effects, "glass") and "35" in reason(effects, "dispersion")
    assert "none of the" in reason(effects, "coat")


def test_what_is_there_in_part_or_shines_is_told_with_its_price(decide: Decide) -> None:
    effects = decide(MATTE | {"alpha": 0.4}, (MATTE | {"emission.0": 1.0, "emission.1": 1.0, "emission.2": 1.0},))
    assert "grey of box-1; sight and light go straight on" in reason(effects, "coverage")
    assert "grey of box-3; paths meet it by chance" in reason(effects, "emission")


def test_what_is_nowhere_there_is_named(decide: Decide) -> None:
    assert choices(decide(MATTE, (MATTE | {"alpha": 0.0},)), "coverage") == ["on", "nothing there"]
    assert "box-3" in reason(decide(MATTE, (MATTE | {"alpha": 0.0},)), "coverage").rpartition("on ")[2]
    assert choices(decide(MATTE, (MATTE | {"alpha": 0.1},)), "coverage") == ["on"]


def test_vertices_and_maps_call_for_their_switches() -> None:
    texture = Texture(base_color=np.ones((1, 1, 3), np.float32), wrap=("clamp", "repeat"))
    leaf = Material(name="leaf", base_color=(1, 1, 1), texture=texture)

    def features(**more: Any) -> set[str]:
        use = MaterialUse(owner="tree", part="furniture", material=leaf, scattered=0.5, smoothest=1, roughest=1, **more)
        scene = SceneUse(materials=(use,), smooth=(), flat=())
        return set(scene_features(scene, FogPlan(), plans.example_plan().render)[0])

    assert features() == {"textures", "maps", "specular"}
    assert features(coloured=True) == {"textures", "maps", "specular", "colours"}
    assert features(coloured=True, coverage=(0.5, 1.0)) == {"textures", "maps", "specular", "colours", "coverage"}


def test_coverage_counts_the_vertices_of_the_faces_that_show_a_material() -> None:
    colors = np.ones((3, 3, 4), np.float32)
    colors[1, 0], colors[2, 1, 3] = (1, 0.5, 1, 1), 0.25
    assert vertex_alphas(np.array([0, 1, 2]), colors) == {1: (1.0, 1.0), 2: (0.25, 1.0)}
    assert vertex_alphas(np.array([0, 0, 0]), colors) == {0: (0.25, 1.0)}
    assert vertex_alphas(np.array([0, 0, 0]), None) == {}
    half = Material(name="half", base_color=(1, 1, 1), alpha=0.5, alpha_cutoff=0.3)
    assert coverage_range(half) == (1, 1) and coverage_range(half, (0.25, 1.0)) == (0, 1)


def test_fog_is_a_feature_with_its_figures(decide: Decide) -> None:
    assert "fog" not in decide().features
    effects = decide(fog=0.2)
    assert "fog" in effects.features and "0.2 per metre" in reason(effects, "fog")


def test_materials_that_no_face_shows_call_for_nothing(decide: Decide, monkeypatch: pytest.MonkeyPatch) -> None:
    make = assets_of_plan.make_furniture
    unused = Material(name="unused", base_color=(1, 1, 1), transmission=1.0)

    def with_unused(**what: Any) -> Any:
        asset = make(**what)
        return replace(asset, materials=(*asset.materials, unused))

    monkeypatch.setattr(assets_of_plan, "make_furniture", with_unused)
    assert "glass" not in decide({"specular": 0.0}).features


@pytest.mark.parametrize(("figures", "effect", "said"), [
    ({"transmission": 1.0, "metallic": 1.0}, "glass", "metal lets no light through"),
    ({"priority": 2.0}, "nested", "no solid glass"),
    ({"transmission": 1.0, "thin": 1.0, "priority": 2.0}, "nested", "no solid glass"),
    ({"transmission": 1.0, "thin": 1.0, "abbe": 40.0}, "nested", "no solid glass"),
    ({"transmission": 1.0, "metallic": 0.9, "abbe": 40.0, "priority": 2.0}, "", ""),
])
def test_what_is_said_of_glass_that_is_none_is_named(decide: Decide, figures: dict[str, float], effect: str,
                                                     said: str) -> None:
    found = {each.effect: each.reason for each in decide(figures).decisions if each.choice == "not honoured"}
    assert list(found) == ([effect] if effect else []) and all(said in why for why in found.values())


def test_what_has_no_material_is_not_told_as_none() -> None:
    named, bare = (MaterialUse(owner="ball", part="furniture", material=Material(name=name, base_color=(1, 1, 1)),
                               scattered=0.5, smoothest=1.0, roughest=1.0) for name in ("oak", "no material"))
    assert (named.name, bare.name) == ("oak of ball", "'no material' of ball")
