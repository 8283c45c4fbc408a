"""What a preview leaves of a plan."""

from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.report import quick_render as quick
from dataset_builder.report.quick_render import quick_plan, quick_render
from tests.plans import example_plan


def test_a_preview_asks_for_little_of_what_the_dataset_has() -> None:
    plan = example_plan(width=1280, height=640)
    found, left_out = quick_plan(plan, denoise=False)
    assert left_out == ()
    assert (found.render.width, found.render.height) == (160, 80)
    assert found.render.layers == (("i_s", "frame"), ("i_t", "frame"), ("s_prime", "object"))
    assert {sum(found.render.parts(name)) for name in ("source", "target", "rough")} == {8}
    assert {each.name: each.extent for each in found.effects.passes if "rough" in each.name} == {
        "first_hit_rough": "object", "rough": "object"}
    assert {each.extent for each in found.effects.passes if "rough" not in each.name} == {"frame"}
    unchanged = {"render", "effects"}
    assert found.model_dump(exclude=unchanged) == plan.model_dump(exclude=unchanged)
    assert [each.max_depth for each in found.effects.passes] == [each.max_depth for each in plan.effects.passes]


def test_a_small_picture_stays_as_it_is_and_layers_are_denoised_where_that_can_be() -> None:
    found, _ = quick_plan(example_plan(width=24, height=20, layers=(("i_t", "object"), ("mask", "object"))),
                          denoise=True)
    assert (found.render.width, found.render.height) == (24, 20)
    assert found.render.layers == (("i_t", "frame"),)
    assert found.render.denoise == ("i_t",)


def test_nothing_waits_for_a_neural_field() -> None:
    plan = example_plan()
    made = FieldPlan(kind="density")
    assert made.made
    found, left_out = quick_plan(plan.model_copy(update={"field": made}), denoise=False)
    assert [name for name, _ in found.render.layers] == ["i_t", "s_prime"]
    assert left_out == ("i_s needs a neural field, which a build makes first",)


def test_a_dataset_without_these_layers_has_no_preview_and_says_so() -> None:
    found = quick_render(None, example_plan(layers=(("mask", "object"),)))  # type: ignore[arg-type]
    assert dict(found.images) == {}
    assert found.missing == f"the dataset has none of {', '.join(quick.LAYERS_SHOWN)}"
