"""Passes to layers: what is traced where, and what is not traced at all."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from dataset_builder.label.example_plan import ExamplePlan, Feature
from dataset_builder.label.scene_plan import MaterialChange, Param
from dataset_builder.layers import LAYERS
from dataset_builder.planning.effects.decisions import plan_effects
from dataset_builder.planning.plan import plan_example
from dataset_builder.planning.scene.box_shell import BoxShell
from dataset_builder.rendering import passes, view_scenes
from dataset_builder.rendering.examples import Rendered, render_view
from dataset_builder.rendering.view_passes import ViewPasses
from dataset_builder.shards.gates import check_gates
from dataset_builder.shards.identities import other_half
from dataset_builder.spec.dataset import GatesSpec
from dataset_builder.spec.load import load_dataset

Plan = Callable[..., ExamplePlan]


@pytest.fixture
def plan(small_spec: Path) -> Plan:
    """Plans example `index` of the small dataset with other layers."""

    def make(index: int = 1, **layers: str) -> ExamplePlan:
        loaded = load_dataset(small_spec)
        whole = plan_example(loaded, index)
        render = whole.render.model_copy(update={"layers": tuple(layers.items())})
        effects = plan_effects(spec=loaded.dataset.render, room=whole.room, shell=BoxShell(whole.room),
                               target=whole.target, render=render, furniture=whole.furniture, fog=whole.fog,
                               camera=whole.camera,
                               source_light=whole.source_light, target_light=whole.target_light,
                               mesh_root=loaded.path.parent)
        return whole.model_copy(update={"render": render, "effects": effects})

    return make


@pytest.fixture
def traced(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[tuple[str, int, bool]]]:
    """(integrand, pixels, lit) of every pass that runs."""
    ran: list[tuple[str, int, bool]] = []
    lights: list[Any] = []
    open_scene = view_scenes.open_scene
    sampler = passes.radiance_sampler
    monkeypatch.setattr(view_scenes, "open_scene",
                        lambda body, light, *rest: lights.append(light) or open_scene(body, light, *rest))
    monkeypatch.setattr(passes, "radiance_sampler", lambda *args: _watched_sampler(sampler(*args), ran, lights))
    for name in ("first_hit", "instances"):
        monkeypatch.setattr(passes, name, _watched(name, getattr(passes, name), ran, lights))
    yield ran


def _watched_sampler(sample: Callable[..., Any], ran: list[tuple[str, int, bool]], lights: list[Any]) -> Any:
    def watched(pixels: np.ndarray, *rest: int) -> Any:
        ran.append(("radiance", len(pixels), lights[-1] is not None))
        return sample(pixels, *rest)
    return watched


def _watched(name: str, run: Callable[..., Any], ran: list[tuple[str, int, bool]], lights: list[Any]) -> Any:
    def watched(view: Any, opened: Any, pixels: np.ndarray, *rest: int) -> Any:
        ran.append((name, len(pixels), lights[-1] is not None))
        return run(view, opened, pixels, *rest)
    return watched


def rendered(*plans: ExamplePlan) -> Rendered:
    """The one example of a plan."""
    example, = render_view(plans, Path())
    return example


def test_a_mask_needs_no_light_and_looks_about_the_object_only(plan: Plan, traced: list[tuple[str, int, bool]]) -> None:
    example = rendered(plan(mask="object"))
    assert list(example.layers) == ["mask"] and set(example.seconds) == {"first_hit"}
    (name, pixels, lit), = traced
    assert name == "first_hit" and not lit
    assert np.count_nonzero(example.layers["mask"]) <= pixels < 24 * 20
    assert {entry.name: entry.paths for entry in example.record.passes} == {
        "first_hit": pixels * 16, "first_hit_rough": 0, "source": 0, "source_clean": 0, "target": 0, "rough": 0,
        "empty": 0, "pbr": 0}


def test_light_is_traced_on_the_object_only(plan: Plan, traced: list[tuple[str, int, bool]]) -> None:
    smooth = plan(i_s="object", s_prime="object")
    example = rendered(smooth.model_copy(update={"rough": smooth.rough.model_copy(update={"sigma": 0.05})}))
    covered, either = (np.count_nonzero(mask) for mask in (
        example.evidence["mask"], example.evidence["mask"] + example.evidence["mask_rough"]))
    assert [pixels for name, pixels, _ in traced if name == "radiance"] == [covered, either]
    assert covered < either < 24 * 20


def test_the_frame_is_traced_where_it_is_wanted(plan: Plan, traced: list[tuple[str, int, bool]]) -> None:
    example = rendered(plan(i_t="frame", depth="object"))
    assert [pixels for name, pixels, _ in traced if name == "radiance"] == [24 * 20]
    assert np.all(example.layers["i_t"].max(axis=2) > 0)
    inside = example.evidence["mask"][..., 0] > 0
    assert np.all(example.layers["depth"][inside] > 0) and not example.layers["depth"][~inside].any()


def test_an_extent_cuts_and_changes_nothing_else(plan: Plan) -> None:
    on_frame = rendered(plan(i_s="frame", d="frame", mask="object")).layers
    on_object = rendered(plan(i_s="frame", d="object", mask="frame")).layers
    assert np.array_equal(on_frame["i_s"], on_object["i_s"])
    inside = on_object["mask"][..., 0] > 0
    assert not on_object["d"][~inside].any() and on_frame["d"][~inside].any()


def test_instances_are_those_of_the_plan(plan: Plan) -> None:
    whole = plan(instance="object", mask="object")
    layers = rendered(whole).layers
    ids = layers["instance"][..., 0]
    assert set(np.unique(ids)) <= {1, 2, *(piece.instance for piece in whole.furniture)}
    assert layers["mask"][ids == 1].min() > 0 and not layers["mask"][ids == 2].all()


def test_an_object_that_is_half_there_and_glows(plan: Plan) -> None:
    """Of closed bodies sight has to pass two faces or more: a quarter or less gets through. Radiance adds up within the
    gate's bounds."""
    layers = {name: "object" for name in ("i_s", "i_t", "d", "s", "spec", "mask", "mask_rough", "s_prime", "instance")}
    opaque = plan(**layers)
    values = {"alpha": 0.5, "emission.0": 0.5, "emission.1": 0.25, "emission.2": 0.0}
    change = MaterialChange(name="*", values=tuple(Param(name=name, value=value) for name, value in values.items()))
    target = opaque.target.model_copy(update={"object": opaque.target.object.model_copy(
        update={"materials": (change,)})})
    features = tuple(name for name in get_args(Feature) if name in (*opaque.effects.features, "coverage", "emission"))
    half = opaque.model_copy(update={"target": target, "effects": opaque.effects.model_copy(
        update={"features": features})})
    there, whole = rendered(half), rendered(opaque)
    for name in ("mask", "mask_rough"):
        solid = whole.layers[name] == 1
        ratio = there.layers[name][solid].mean()
        assert 0.7 < ratio < 0.99
    assert there.layers["spec"][whole.layers["mask"][..., 0] == 1].mean(axis=0)[0] > 0.15
    assert not check_gates(there.layers, GatesSpec(mask_overlap=0.3), there.evidence, (16, 16))


def test_direct_light_is_s_prime_without_bounces_from_as_many_samples(plan: Plan) -> None:
    """Paths of two edges find nothing else, so that both are one image then, of different samples."""
    deep = plan(s_prime="object")
    shallow = deep.model_copy(update={"effects": deep.effects.model_copy(update={"passes": tuple(
        entry.model_copy(update={"max_depth": 2}) for entry in deep.effects.passes)})})
    found = {}
    for name, whole in (("deep", deep), ("shallow", shallow)):
        shared = ViewPasses(plan=whole, mesh_root=Path())
        found[name] = [(part.pixels, part.found.mean, part.found.error, part.found.spp.sum())
                       for part in (shared.rough(whole), shared.rough_direct(whole))]
        shared.scenes.close()
    (pixels, both, error, paths), (lit, direct, noise, own_paths) = found["shallow"]
    assert np.array_equal(pixels, lit) and paths == own_paths and not np.array_equal(both, direct)
    assert abs((both - direct).sum()) < 4 * np.sqrt((error**2 + noise**2).sum())
    assert np.array_equal(found["deep"][1][1], direct) and found["deep"][0][1].mean() > 1.1 * direct.mean()


def test_standard_errors_are_of_their_layers(plan: Plan) -> None:
    layers = rendered(plan(i_t="object", i_t_se="object", mask="object")).layers
    inside = layers["mask"][..., 0] > 0
    assert not layers["i_t_se"][~inside].any() and layers["i_t_se"].min() >= 0
    assert 0 < layers["i_t_se"][inside].mean() < layers["i_t"][inside].mean()


def test_halves_are_independent_pictures_of_the_same_light(plan: Plan) -> None:
    """Half of their difference has the variance that the standard error says: e^2 is that of (a + b) / 2."""
    layers = rendered(plan(i_t="object", i_t_half="object", i_t_se="object", mask="object")).layers
    i_t, half = (layers[name].astype(np.float64) for name in ("i_t", "i_t_half"))
    inside, other = layers["mask"][..., 0] == 1, 2 * i_t - half
    assert not half[layers["mask"][..., 0] == 0].any() and not np.array_equal(half, other)
    assert other_half(layers["i_t"], layers["i_t_half"], 1e-5) == []
    variance = (((half - other) / 2)[inside] ** 2).mean() / (layers["i_t_se"][inside].astype(np.float64) ** 2).mean()
    assert 0.7 < variance < 1.4


def test_layers_have_their_channels_and_ranges(plan: Plan) -> None:
    wanted = {name: "object" for name in LAYERS}
    layers = rendered(plan(**wanted)).layers
    assert list(layers) == list(LAYERS)
    for name, array in layers.items():
        layer = LAYERS[name]
        assert array.shape == (20, 24, layer.channels) and array.dtype == np.float32
        assert layer.low - 1e-5 <= array.min() and array.max() <= layer.high + 1e-5
        assert layer.low < 0 or array.min() >= 0


def test_rounding_leaves_no_specular_part_below_zero(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is a difference of floats; a layer of radiance may not be negative at all."""
    sampler = passes.radiance_sampler
    monkeypatch.setattr(passes, "radiance_sampler", lambda *args: lambda *rest: _rounded(sampler(*args)(*rest)))
    layers = rendered(plan(spec="object", i_t="object", mask="object")).layers
    assert layers["spec"].min() == 0 < layers["spec"].max() and layers["i_t"].min() >= 0


def _rounded(found: Any) -> Any:
    """An estimate whose first pixel has a specular part a hair below zero."""
    mean = found.mean.copy()
    mean[0, 6:9] = -1e-9
    return replace(found, mean=mean)


def test_views_are_not_mixed(plan: Plan) -> None:
    with pytest.raises(ValueError, match="expected plans of one view"):
        rendered(plan(0, mask="object"), plan(4, mask="object"))
