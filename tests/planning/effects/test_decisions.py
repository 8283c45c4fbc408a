"""What is decided to be simulated: the figures behind it, and that nothing a scene calls for is lost."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from dataset_builder.assets.asset import Material, Texture, coverage_range, vertex_alphas
from dataset_builder.errors import PlanError
from dataset_builder.label.example_plan import EffectsPlan, Feature
from dataset_builder.label.scene_plan import (
    FogPlan,
    IlluminationPlan,
    LightPlan,
    MaterialChange,
    ObjectPlan,
    Param,
    PlacedObject,
    RoomPlan,
)
from dataset_builder.planning.effects.decisions import PASSES, plan_effects
from dataset_builder.planning.effects.features import scene_features
from dataset_builder.planning.effects.materials_used import MaterialUse, SceneUse
from dataset_builder.planning.plan import Planner, first_plan
from dataset_builder.planning.precheck import probe
from dataset_builder.planning.scene.box_shell import BoxShell
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.render import RenderSpec
from dataset_builder.spec.resolve import LoadedSpec
from tests import plans

SPECS = Path(__file__).parents[3] / "scene_specs"
MATTE = {"specular": 0.0, "base_color.0": 0.5, "base_color.1": 0.5, "base_color.2": 0.5}
GLASS = {"transmission": 1.0, "roughness": 0.0, "specular": 0.04}
PAPER = (("i_s", "frame"), ("d", "object"), ("r", "object"), ("i_t", "object"), ("s_prime", "object"),
         ("mask", "object"))


def lamp(kind: str, radiance: float = 1.0) -> LightPlan:
    return plans.light_plan(kind, (radiance,) * 3)


def placed(number: int, **values: float) -> PlacedObject:
    change = MaterialChange(name="*", values=tuple(Param(name=key, value=value) for key, value in values.items()))
    plan = ObjectPlan(name=f"box-{number}", kind="procedural", source="chair", source_sha256="", category="chair",
                      licence="CC0-1.0", seed="0", params=(), materials=(change,), scale=1.0, up="z")
    return PlacedObject(object=plan, instance=number, position=(0.3 * (number - 1), 0, 0), yaw=0)


@pytest.fixture
def decide(monkeypatch: pytest.MonkeyPatch, room_of: Callable[..., RoomPlan]) -> Callable[..., EffectsPlan]:
    """Effects of a grey box, changed by figures, in a closed room; everything else on demand."""

    def make(target: dict[str, float] | None = None, others: tuple[dict[str, float], ...] = (), *,
             room: dict[str, Any] | None = None, lights: tuple[LightPlan, ...] = (lamp("area"),), fog: float = 0.0,
             albedo: float = 0.9,
             layers: tuple[tuple[str, str], ...] = PAPER, opened: tuple[str, ...] = ("ceiling", "walls"),
             **spec: Any) -> EffectsPlan:
        render = plans.example_plan(layers=layers).render
        furniture = tuple(placed(3 + k, **figures) for k, figures in enumerate(others))
        plan = room_of().model_copy(update=room or {})
        return plan_effects(
            spec=RenderSpec.model_validate(spec), room=plan, shell=BoxShell(plan), camera=plans.example_plan().camera,
            target=placed(1, **(target or MATTE)), furniture=furniture,
            source_light=IlluminationPlan(lights=(lamp("dome"),), open=opened),
            target_light=IlluminationPlan(lights=lights, open=()), fog=FogPlan(extinction=fog, albedo=albedo),
            render=render, mesh_root=Path())

    return make


def choices(effects: EffectsPlan, effect: str) -> list[str]:
    return [decision.choice for decision in effects.decisions if decision.effect == effect]


def reason(effects: EffectsPlan, effect: str) -> str:
    return " ".join(decision.reason for decision in effects.decisions if decision.effect == effect)


Decide = Callable[..., EffectsPlan]


@pytest.mark.parametrize("how", [{}, {"effects": "all"}, {"max_depth": 7}, {"fog": 0.1}])
def test_every_decision_has_a_reason_and_every_pass_an_entry(decide: Decide, how: dict[str, Any]) -> None:
    effects = decide(GLASS, (MATTE,), **how)
    assert all(decision.effect and decision.choice and decision.reason for decision in effects.decisions)
    assert tuple(entry.name for entry in effects.passes) == PASSES
    assert set(get_args(Feature)) <= {decision.effect for decision in effects.decisions}


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


def test_fog_that_no_planned_path_gets_through_is_refused(decide: Decide) -> None:
    with pytest.raises(PlanError, match=r"paths of at most 512 edges.*got an extinction of 30 per metre"):
        decide(fog=30.0, albedo=1.0)
    assert decide(fog=30.0, albedo=1.0, max_depth=20).of("target").max_depth == 20


def test_materials_that_no_face_shows_call_for_nothing(decide: Decide, monkeypatch: pytest.MonkeyPatch) -> None:
    from dataclasses import replace

    from dataset_builder.assets.asset import Material
    from dataset_builder.planning.scene import assets_of_plan

    make = assets_of_plan.make_furniture
    unused = Material(name="unused", base_color=(1, 1, 1), transmission=1.0)

    def with_unused(**what: Any) -> Any:
        asset = make(**what)
        return replace(asset, materials=(*asset.materials, unused))

    monkeypatch.setattr(assets_of_plan, "make_furniture", with_unused)
    assert "glass" not in decide({"specular": 0.0}).features


def test_the_dome_is_dropped_where_it_finds_no_way_in(decide: Decide) -> None:
    lights = (lamp("dome"), lamp("area"), lamp("point", 0.0))
    closed = decide(lights=lights)
    assert closed.of("target").lights == closed.of("rough").lights == (1,)
    assert closed.of("source").lights == (0,)
    assert "cannot enter a room" in reason(closed, "lights of target")
    assert decide(lights=lights, room={"windows": 1}).of("target").lights == (0, 1)
    assert decide(lights=lights, room={"ceiling": False}).of("target").lights == (0, 1)


@pytest.mark.parametrize("how", [{}, {"effects": "all"}])
def test_a_pass_that_runs_in_the_dark_is_refused(decide: Decide, how: dict[str, Any]) -> None:
    with pytest.raises(PlanError, match=r"source: expected a light .* in the pass source, got none: dome left out: "
                       r"cannot enter a room with a ceiling and no windows \(remove parts of the room"):
        decide(opened=(), **how)
    with pytest.raises(PlanError) as caught:
        decide(opened=(), lights=(lamp("dome"), lamp("area", 0.0)), **how)
    assert [problem.path for problem in caught.value.problems] == ["source", "target", "target"]
    assert decide(opened=(), layers=(("i_t", "object"), ("mask", "object")), **how).of("target").lights == (0,)
    assert decide(opened=(), room={"windows": 1}, **how).of("source").lights == (0,)


def test_a_source_that_finds_no_way_in_is_told_before_anything_is_rendered(load: Callable[..., LoadedSpec],
                                                                         dataset_data: dict[str, Any]) -> None:
    dataset_data["source"] = {"open": []}
    with pytest.raises(PlanError, match=r"train/000000.*source: expected a light"):
        probe(Planner(load(dataset_data, room={"width": 6, "depth": 5, "height": 2.8, "windows": 0})))


def test_passes_that_no_layer_needs_do_not_run(decide: Decide) -> None:
    effects = decide(layers=(("i_t", "object"), ("mask", "frame")))
    assert choices(effects, "pass source") == choices(effects, "pass rough") == ["not run"]
    assert "none of its layers is requested" in reason(effects, "pass source")
    assert choices(effects, "pass target") == ["object"]
    assert choices(effects, "path depth of source") == choices(effects, "transport of source") == []
    assert choices(decide(layers=(("s_prime", "object"),)), "pass first_hit_rough") == ["object"]


def test_pixels_are_those_that_a_layer_asks_for(decide: Decide) -> None:
    effects = decide()
    assert [effects.of(name).extent for name in PASSES] == ["object", "frame", *["object"] * 6]
    assert reason(effects, "pass source").endswith("i_s")
    assert choices(effects, "light-free layers") == ["3 of 6"]


def test_depth_counts_only_what_stands_in_a_pass(decide: Decide) -> None:
    """Without walls and ceiling most light leaves at once."""
    dark = {"base_color.0": 0.1, "base_color.1": 0.1, "base_color.2": 0.1, "specular": 0.0}
    bright = {f"base_color.{k}": 0.9 for k in range(3)} | {"specular": 0.0}
    effects, asked = decide(dark, (dark,), bias=0.01), decide(dark, (bright,), bias=0.01)
    assert asked.of("target").max_depth > effects.of("source").max_depth
    assert "99.9% bound" in reason(asked, "path depth of target")
    assert len({entry.max_depth for entry in asked.passes if entry.name in ("target", "rough", "empty", "pbr")}) == 1
    assert [decide(max_depth=9).of(name).max_depth for name in PASSES] == [1, 9, 9, 9, 1, 9, 9, 9]


def test_all_simulates_everything_everywhere(decide: Decide) -> None:
    effects = decide(effects="all", lights=(lamp("dome"), lamp("area"), lamp("point", 0.0)), max_depth=4)
    assert effects.features == get_args(Feature)
    assert {entry.extent for entry in effects.passes} == {"frame"}
    assert {entry.max_depth for entry in effects.passes} == {128}
    assert {entry.max_depth for entry in decide(effects="all", max_depth=200).passes} == {200}
    assert effects.of("rough").lights == (0, 1, 2) and effects.of("source").lights == (0,)
    everything = "everything simulated, as requested"
    assert {decision.reason for decision in effects.decisions} == {
        everything, f"{everything}; light paths know no fog"}
    assert {entry.transport for entry in effects.passes} == {"camera"}


def test_what_belongs_to_the_view_does_not_follow_the_target_light(decide: Decide) -> None:
    one, other = decide(GLASS, lights=(lamp("point"),)), decide(GLASS, lights=(lamp("area"), lamp("dome")))
    assert one.features == other.features
    for name in ("first_hit", "source", "first_hit_rough"):
        assert one.of(name) == other.of(name)


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


# Specs

@pytest.fixture
def real(monkeypatch: pytest.MonkeyPatch) -> None:
    """The embedded furniture and rooms instead of boxes."""
    from dataset_builder.assets.procedural.furniture import make_furniture
    from dataset_builder.assets.procedural.rooms import make_room
    from dataset_builder.planning.scene import assets_of_plan

    monkeypatch.setattr(assets_of_plan, "make_furniture", make_furniture)
    monkeypatch.setattr(assets_of_plan, "make_room", make_room)


@pytest.mark.usefixtures("real")
def test_the_shipped_dataset_of_effects_has_them_all() -> None:
    planner = Planner(load_dataset(SPECS / "3df-lighting-effects.yaml"))
    made = [planner.example(ref) for ref in planner.examples]
    # Colours of vertices, further maps and what is in a bottle come with mesh files alone
    expected = set(get_args(Feature)) - {"colours", "maps", "nested"}
    assert {feature for plan in made for feature in plan.effects.features} == expected
    for plan in made:
        glazed = plan.room.glazing and plan.room.windows > 0
        assert ("thin" in plan.effects.features) == glazed
        things = (plan.target, *plan.furniture)
        transmits = any(param.name == "transmission" for thing in things for change in thing.object.materials
                        for param in change.values)
        vases = any(thing.object.source == "vase" and Param(name="finish", value=1) in thing.object.params
                    for thing in things)
        assert ("glass" in plan.effects.features) == (transmits or vases)
        assert ("dispersion" in plan.effects.features) == vases
        assert ("fog" in plan.effects.features) == (plan.fog.extinction > 0)


@pytest.mark.usefixtures("real")
def test_the_mini_dataset_has_no_use_for_glass() -> None:
    plan = first_plan(Planner(load_dataset(SPECS / "3df-lighting-mini.yaml")))
    assert plan is not None and plan.effects.features == ("textures", "specular")
    assert choices(plan.effects, "normals") == ["smooth"]


@pytest.mark.usefixtures("real")
def test_panes_move_no_camera_and_no_light(load: Callable[..., LoadedSpec]) -> None:
    room = {"width": 6, "depth": 5, "height": 2.8, "windows": 3}
    planned = [Planner(load(room=room | {"glazing": glazing})) for glazing in (False, True)]
    for index in (0, 3):
        bare, glazed = (planner.example(planner.examples[index]) for planner in planned)
        assert "thin" in glazed.effects.features and "thin" not in bare.effects.features
        for name in ("camera", "target", "furniture", "source_light", "target_light", "notes"):
            assert getattr(bare, name) == getattr(glazed, name)


def test_fog_is_drawn_with_the_scene(load: Callable[..., LoadedSpec], scene_data: dict[str, Any]) -> None:
    scene_data["fog"] = {"extinction": {"uniform": [0.1, 0.2]}, "anisotropy": 0.3}
    planner, clear = Planner(load(scene=scene_data)), Planner(load())
    first, other, plain = (each.example(each.examples[index]) for each, index in ((planner, 0), (planner, 1),
                                                                                 (clear, 0)))
    assert 0.1 <= first.fog.extinction <= 0.2 and (first.fog.albedo, first.fog.anisotropy) == (0.9, 0.3)
    assert first.view == other.view and first.fog == other.fog
    assert plain.fog == FogPlan() and plain.camera == first.camera and plain.target_light == first.target_light


def test_the_first_plan_passes_over_what_cannot_be_planned(load: Callable[..., LoadedSpec],
                                                           monkeypatch: pytest.MonkeyPatch) -> None:
    planner = Planner(load())
    whole = planner.example

    def example(ref: Any) -> Any:
        if ref.index < 2:
            raise PlanError("not this one")
        return whole(ref)

    monkeypatch.setattr(planner, "example", example)
    assert first_plan(planner).index == 2  # type: ignore[union-attr]
    assert first_plan(planner, most=2) is None


def test_planning_does_without_the_renderer() -> None:
    code = ("import sys\nfrom dataset_builder.planning.plan import plan_example\n"
            "from dataset_builder.spec.load import load_dataset\n"
            f"plan = plan_example(load_dataset({str(SPECS / '3df-lighting-effects.yaml')!r}), 0)\n"
            "assert plan.effects.decisions\nprint('mitsuba' in sys.modules or 'drjit' in sys.modules)")
    assert subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout == "False\n"
