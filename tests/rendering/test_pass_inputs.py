"""What a pass depends on: every change of a plan runs the passes that it touches again, and no other."""

from collections.abc import Callable

import pytest

from dataset_builder.label.example_plan import ExamplePlan, GoalPlan, RoughStep, SppPart
from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.label.scene_plan import MaterialChange, Param, PortalPlan
from dataset_builder.label.scene_source import SceneThingPlan
from dataset_builder.rendering.pass_inputs import (
    DIRECT,
    all_passes,
    goals_at,
    inputs_of,
    key_of,
    sky_radiance,
    steps_of,
)
from tests.plans import effects_plan, example_plan

PASSES = ("first_hit", "instance", "source", "target", "first_hit_rough", "rough", "pbr", "empty", "lighting")
UNDER_TARGET = {"target", "rough", "pbr", "empty", "first_hit_rough", "lighting"}
LIT = {"source", "target", "rough", "pbr", "empty"}
OF_ROUGH = {"first_hit_rough", "rough", "pbr"}
LAYERS = tuple((name, "object") for name in ("i_s", "i_t", "s_prime", "d", "mask", "mask_rough", "instance",
                                              "i_t_empty", "i_pbr"))
Edit = Callable[[ExamplePlan], ExamplePlan]


def plan() -> ExamplePlan:
    """An example with layers of every pass."""
    found = example_plan()
    return found.model_copy(update={"render": found.render.model_copy(update={"layers": LAYERS})})


def within(path: str, **values: object) -> Edit:
    """Replace values in the part of a plan at a dotted path."""
    def edit(whole: ExamplePlan) -> ExamplePlan:
        def changed(part, names):
            if not names:
                return part.model_copy(update=values)
            return part.model_copy(update={names[0]: changed(getattr(part, names[0]), names[1:])})
        return changed(whole, [name for name in path.split(".") if name])
    return edit


def lamp(light: str, **values: object) -> Edit:
    """Replace values of the first light of an illumination."""
    def edit(whole: ExamplePlan) -> ExamplePlan:
        found = getattr(whole, light)
        first = found.lights[0].model_copy(update=values)
        return whole.model_copy(update={light: found.model_copy(update={"lights": (first, *found.lights[1:])})})
    return edit


def of_passes(**values: object) -> Edit:
    """Replace values of what every pass simulates."""
    return within("effects", passes=tuple(entry.model_copy(update=values) for entry in effects_plan().passes))


def opened(*names: str) -> Edit:
    """Let samples of the dome go through a window in some passes."""
    window = PortalPlan(corner=(0, 2, 1), right=(1, 0, 0), up=(0, 0, 1))

    def edit(whole: ExamplePlan) -> ExamplePlan:
        passes = tuple(each.model_copy(update={"portals": (window,)}) if each.name in names else each
                       for each in whole.effects.passes)
        return whole.model_copy(update={"effects": whole.effects.model_copy(update={"passes": passes})})
    return edit


EDITS: dict[str, tuple[Edit, set[str]]] = {
    "key, index, view, notes": (within("", key="00000099", index=99, view="train/000077", notes=("x",)), set()),
    "names": (within("target.object", name="other", category="other", licence="other"), set()),
    "name of the room": (within("room", name="other"), set()),
    "path and licence of a scene file": (within("room.scene.file", source="a.glb", licence="MIT", roots=("b",),
                                                models="m", textures="t"), set()),
    "what a scene's things are called": (within("room.scene", things=(SceneThingPlan(
        instance=3, name="a", category="chair", licence="MIT"),)), set()),
    "a thing that is taken away": (within("room.scene", hidden=("a",)), set(PASSES)),
    "content of a scene file": (within("room.scene.file", source_sha256="0"), set(PASSES)),
    "scale of a scene file": (within("room.scene.file", scale=0.01), set(PASSES)),
    "path of a target's scene": (within("target.object.scene", source="a.glb"), set()),
    "place of a target in its scene": (within("target.object", linear=(2.0,) * 9), set(PASSES)),
    "estimates of the camera": (within("camera", coverage=0.3, visibility=0.5), set()),
    "layers": (within("render", layers=LAYERS[::-1]), set()),
    "denoising": (within("render", denoise=("i_t",), keep_raw=True), set()),
    "colour temperature and file of a lamp": (lamp("target_light", temperature=3000.0, image="other.png"), set()),
    "target light": (lamp("target_light", radiance=(9.0, 9.0, 9.0)), UNDER_TARGET),
    "position of a lamp": (lamp("target_light", position=(0.1, 0.2, 2.0)), UNDER_TARGET),
    "number of the light": (within("", light=3), UNDER_TARGET),
    "image of a lamp": (lamp("target_light", image_sha256="0"), UNDER_TARGET),
    "source light": (lamp("source_light", radiance=(9.0, 9.0, 9.0)), {"source"}),
    "camera": (within("camera", fov=41.0), set(PASSES) - {"lighting"}),
    "size of the image": (within("render", width=9), set(PASSES) - {"lighting"}),
    "alpha": (within("target.object", materials=(MaterialChange(name="*", values=(Param(name="alpha", value=0.5),)),)),
              set(PASSES)),
    "emission": (within("target.object", materials=(MaterialChange(name="*", values=(
        Param(name="emission.0", value=2.0),)),)), set(PASSES)),
    "noise": (within("rough", sigma=0.02), OF_ROUGH),
    "level": (within("rough", level=4), OF_ROUGH),
    "steps of noise": (within("rough", steps=(RoughStep(kind="smooth", along="isotropic", values=()),)),
                       OF_ROUGH),
    "name of a level": (within("rough", name="heavy"), set()),
    "triangles of a scan": (within("rough", coarsen=True), OF_ROUGH),
    "noise at the support": (within("rough", above_support=True), OF_ROUGH),
    "spp of the target": (within("render", spp_target=128), {"target", "pbr", "empty"}),
    "spp of the light-free passes": (within("render", spp_first_hit=128), {"first_hit", "first_hit_rough", *LIT}),
    "roulette": (within("render", rr_depth=9), LIT | {"lighting"}),
    "target object": (within("target.object", seed="7"), set(PASSES)),
    "place of the object": (within("target", yaw=7.0), set(PASSES)),
    "room": (within("room", height=2.9), set(PASSES)),
    "furniture": (within("", furniture=()), set(PASSES)),
    "texture size": (within("render", texture_size=64), set(PASSES)),
    "seed": (within("render", seed="4711"), set(PASSES)),
    "transport": (of_passes(transport="joined"), LIT),
    "whether anything throws caustics": (of_passes(caustics=True), LIT),
    "openings of the target pass": (opened("target"), {"target", "lighting"}),
    "openings of the rough pass": (opened("rough"), {"rough"}),
    "features": (within("effects", features=("textures",)), set(PASSES)),
}


def keys(whole: ExamplePlan) -> dict[str, str]:
    return {name: key_of(inputs_of(whole, name), {}) for name in PASSES}


@pytest.mark.parametrize("what", EDITS)
def test_a_change_touches_the_passes_that_see_it(what: str) -> None:
    edit, touched = EDITS[what]
    before, after = keys(plan()), keys(edit(plan()))
    assert edit(plan()) != plan()
    assert {name for name in PASSES if before[name] != after[name]} == touched


def test_where_something_shines_every_light_pass_depends_on_the_source_sky() -> None:
    """Its radiance is in units of that."""
    shining = within("effects", features=(*plan().effects.features, "emission"))(plan())
    brighter = lamp("source_light", weight=9.0)(shining)
    assert sky_radiance(brighter) == pytest.approx(9 / 3.14159265)
    before, after = keys(shining), keys(brighter)
    assert {name for name in PASSES if before[name] != after[name]} == {*LIT, "lighting"}


def test_passes_that_are_compared_know_each_other_where_paths_are_joined() -> None:
    """Camera paths are in step by themselves: what stands beside changes nothing."""
    def key(joined: bool, *layers: str, name: str = "target") -> str:
        found = of_passes(transport="joined")(plan()) if joined else plan()
        asked = tuple((layer, "object") for layer in layers)
        render = found.render.model_copy(update={"layers": asked})
        return key_of(inputs_of(found.model_copy(update={"render": render}), name), {})

    assert key(False, "i_t") == key(False, "i_t", "i_t_empty") == key(False, "i_t", "i_pbr")
    assert len({key(True, "i_t"), key(True, "i_t", "i_t_empty"), key(True, "i_t", "i_pbr")}) == 3
    assert key(True, "i_t", "s_prime") == key(True, "i_t")
    assert key(True, "i_t_empty", "i_pbr", name="pbr") != key(True, "i_pbr", name="pbr")


def test_every_pass_has_a_key_of_its_own() -> None:
    assert set(all_passes(plan())) == set(PASSES)
    assert len(set(keys(plan()).values())) == len(PASSES)


def test_direct_light_is_traced_where_s_prime_is_denoised_and_depends_on_what_that_does() -> None:
    smooth = within("render", denoise=("s_prime",))(plan())
    assert set(all_passes(smooth)) == {*PASSES, DIRECT} and DIRECT not in all_passes(within(
        "render", denoise=("i_t", "s"))(plan()))
    for name in EDITS:
        before, after = ({which: key_of(inputs_of(whole, which), {}) for which in ("rough", DIRECT)}
                         for whole in (smooth, EDITS[name][0](smooth)))
        assert before["rough"] != before[DIRECT]
        assert (before["rough"] == after["rough"]) == (before[DIRECT] == after[DIRECT])


def test_versions_are_part_of_a_key() -> None:
    inputs = inputs_of(plan(), "target")
    assert key_of(inputs, {"mitsuba": "3.9"}) != key_of(inputs, {"mitsuba": "3.10"})


def test_a_mesh_file_counts_by_its_content_not_by_its_path() -> None:
    file = within("target.object", kind="file", source="a.glb", source_sha256="1")(plan())
    assert keys(file) == keys(within("target.object", source="elsewhere/b.glb")(file))
    assert keys(file) != keys(within("target.object", source_sha256="2")(file))
    assert keys(plan()) != keys(within("target.object", source="chair")(plan()))


def test_appended_parts_share_the_keys_of_the_first() -> None:
    one = within("render", spp_target=64)(plan())
    parts = (SppPart(render_pass="target", spp=64), SppPart(render_pass="target", spp=192))
    two = within("render", spp_target=256, spp_parts=parts)(plan())
    assert (steps_of(one, "target"), steps_of(two, "target"), steps_of(two, "source")) == (1, 2, 1)
    assert inputs_of(two, "target", 1) == inputs_of(one, "target") != inputs_of(two, "target")


def goal(error: float, layer: str = "i_t") -> GoalPlan:
    return GoalPlan(layer=layer, error=error, seconds=0.0, cap=4096)


def test_appended_goals_share_the_keys_of_the_first() -> None:
    one = within("render", goals=(goal(0.2), goal(0.1, "s_prime")))(plan())
    two = within("render", goals=(goal(0.2), goal(0.1), goal(0.1, "s_prime")))(plan())
    assert steps_of(two, "target") == 2 and steps_of(two, "rough") == 1
    assert inputs_of(two, "target", 1) == inputs_of(one, "target") != inputs_of(two, "target")
    assert inputs_of(two, "rough") == inputs_of(one, "rough")


def test_a_layer_with_fewer_goals_keeps_its_last() -> None:
    found = within("render", goals=(goal(0.2), goal(0.1), goal(0.3, "s")))(plan())
    assert goals_at(found, "target", 0) == (goal(0.2), goal(0.3, "s"))
    assert goals_at(found, "target", 1) == (goal(0.1), goal(0.3, "s"))
    assert goals_at(found, "source", 0) == ()


@pytest.mark.parametrize(("edit", "again"), [
    (within("field", views=51), True), (within("field", kind="own"), True), (within("camera", fov=41.0), True),
    (within("target.object", seed="7"), True), (within("render", spp_source=128), True),
    (within("room.scene.file", source_sha256="0"), False), (opened("source"), False),
    (lamp("target_light", radiance=(9.0, 9.0, 9.0)), False), (within("rough", sigma=0.02), False),
])
def test_what_is_seen_through_a_field_depends_on_that_alone(edit: Edit, again: bool) -> None:
    seen = plan().model_copy(update={"field": FieldPlan(kind="density", views=50)})
    keys = [key_of(inputs_of(each, "source"), {}) for each in (plan(), seen, edit(seen))]
    assert keys[0] != keys[1] and (keys[1] != keys[2]) == again
