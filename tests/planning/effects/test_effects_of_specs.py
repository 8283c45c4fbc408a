"""Effects of whole specs: the shipped ones, panes and fog, and that nothing else moves with them."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import pytest

from dataset_builder.errors import PlanError
from dataset_builder.label.example_plan import Feature
from dataset_builder.label.scene_plan import FogPlan, Param
from dataset_builder.planning.plan import Planner, first_plan
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.resolve import LoadedSpec
from tests.planning.effects.decided import choices

SPECS = Path(__file__).parents[3] / "scene_specs"


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
