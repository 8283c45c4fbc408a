"""Honest layers keep every bound, also where they are noisy, dark or of metal; spoilt ones are refused by name."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.label.scene_plan import CameraPlan, FogPlan
from dataset_builder.release.cells import Cells, cell_side, cells_of, eroded
from dataset_builder.release.consistency import RULES, check_facts, facts
from dataset_builder.release.dataset_check import Check, Rule
from dataset_builder.release.light_checks import light_checks
from dataset_builder.release.shape_checks import SEARCH, edge_scores, surface_checks, surface_of
from dataset_builder.seeding import rng
from dataset_builder.shards.example import Example
from tests.lightnet.synthetic import PAPER_AND_ROUGH, synthetic_example
from tests.plans import example_plan, render_record
from tools.sabotage import KINDS, Source, partners

COUNT, SIZE = 30, 64
LIGHT = ("energy", "excess", "spread", "albedo_slope", "light_slope", "shading", "odd_examples", "source_slope",
         "source_spread")
Layers = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def honest() -> dict[str, Example]:
    """Examples whose S' is of facets that stray by 30 degrees and more."""
    examples = [synthetic_example(2 * index, size=SIZE, levels=2) for index in range(COUNT)]
    return {example.key: example for example in examples}


def checks(examples: Iterable[Example]) -> dict[str, Check]:
    return {check.name: check
            for check in check_facts(facts(one.layers, one.plan, one.record) for one in examples)}


def times(example: Example, factor: float) -> Example:
    """The example with S' of another strength."""
    return replace(example, layers={**example.layers, "s_prime": example.layers["s_prime"] * np.float32(factor)})


def refused(found: Mapping[str, Check]) -> set[str]:
    return {name for name, check in found.items() if not check.holds}


@dataclass(frozen=True, kw_only=True)
class InMemory:
    """As much of a dataset as sabotage needs."""

    examples: Mapping[str, Example]

    def __getitem__(self, key: str) -> Layers:
        return dict(self.examples[key].layers)

    @property
    def manifest(self) -> Any:
        layers = [type("Layer", (), {"name": name, "extent": "frame" if name in ("i_s", "i_t") else "object"})
                  for name in PAPER_AND_ROUGH]
        return type("Manifest", (), {"layers": layers})


def spoilt(honest: Mapping[str, Example], kind: str) -> list[dict[str, Any]]:
    source = Source(dataset=InMemory(examples=honest), partner=partners(list(honest)))  # type: ignore[arg-type]
    return [replace(example, layers={**example.layers, **KINDS[kind](source, key, dict(example.layers))})
            for key, example in honest.items()]


def test_images_of_fields_are_not_held_to_the_source_light(honest: dict[str, Example]) -> None:
    """A gamma of i_s is refused where it is rendered; of a field i_s_clean is looked at, or nothing."""
    def seen(one: Example, **layers: np.ndarray) -> Example:
        plan = one.plan.model_copy(update={"field": FieldPlan(kind="density")})
        return replace(one, plan=plan, layers={**one.layers, "i_s": one.layers["i_s"] ** 0.4, **layers})

    assert "source_slope" in refused(checks(replace(one, layers=seen(one).layers) for one in honest.values()))
    without = checks(seen(one) for one in honest.values())
    assert refused(without) == set() and not without["source_slope"].judged and without["albedo_slope"].judged
    clean = checks(seen(one, i_s_clean=one.layers["i_s"]) for one in honest.values())
    assert refused(clean) == set() and clean["source_slope"].judged
    spoilt_clean = checks(seen(one, i_s_clean=one.layers["i_s"] ** 0.4) for one in honest.values())
    assert "source_slope" in refused(spoilt_clean)


def test_honest_layers_keep_every_bound(honest: dict[str, Example]) -> None:
    found = checks(honest.values())
    assert refused(found) == set()
    assert list(found) == [rule.name for rule in RULES]
    assert {name for name, check in found.items() if check.judged} >= {*LIGHT, "diffuse_share", "support", "drift",
                                                                       "edges"}
    assert found["albedo_slope"].value == pytest.approx(1, abs=0.25)
    assert found["edges"].value == 0


@pytest.mark.parametrize(("kind", "names"), [
    ("shuffle_s_prime", {"light_slope", "shading"}), ("shuffle_s_prime_fitted", {"light_slope", "shading"}),
    ("shuffle_s_prime_matched", {"shading"}), ("swap_d_r", {"diffuse_share"}),
    ("gamma_i_s", {"source_slope"}), ("gamma_i_t", {"albedo_slope", "light_slope"}),
    ("gamma_s_prime", {"light_slope"}), ("gamma_d", {"energy", "albedo_slope", "source_slope"}),
    ("shift_mask", {"support", "drift", "edges"}), ("shift_mask_cut", {"support", "drift", "edges"}),
    ("shift_object", {"edges"}),
])
def test_spoilt_layers_are_refused_by_name(honest: dict[str, Example], kind: str, names: set[str]) -> None:
    assert refused(checks(spoilt(honest, kind))) >= names


@pytest.mark.parametrize(("factor", "name"), [(np.pi, "energy"), (1 / np.pi, "excess")])
def test_a_forgotten_pi_is_found(honest: dict[str, Example], factor: float, name: str) -> None:
    changed = [times(example, factor) for example in honest.values()]
    assert name in refused(checks(changed))


def test_one_foreign_example_in_ten_is_found_and_named(honest: dict[str, Example]) -> None:
    changed = [times(example, 6 if number in (3, 11, 17) else 1) for number, example in enumerate(honest.values())]
    found = checks(changed)["odd_examples"]
    assert not found.holds
    assert all(changed[number].key in found.detail for number in (3, 11, 17))


def noisy(layers: Mapping[str, np.ndarray], key: str) -> Layers:
    """Monte Carlo noise: a gamma distribution of relative error 0.7, and one pixel in 300 eleven times too bright."""
    changed = dict(layers)
    for name in ("i_s", "i_t", "s_prime"):
        stream = rng(1, key, name)
        noise = stream.gamma(2.0, 0.5, layers[name].shape[:2]) + 10 * (stream.random(layers[name].shape[:2]) < 1 / 300)
        changed[name] = layers[name] * noise[..., None]
    return changed


def metal(layers: Mapping[str, np.ndarray], key: str) -> Layers:
    """D is 0; what R reflects has nothing to do with S'."""
    covered, stream = layers["mask"] > 0, rng(2, key)
    r = 0.8 * covered * stream.uniform(0.7, 1, 3)
    seen = np.exp(stream.normal(-1, 1.5, layers["i_t"].shape[:2]))[..., None]
    return {**layers, "d": layers["d"] * 0, "r": r, "i_t": np.where(covered, r * seen, layers["i_t"]),
            "i_s": np.where(covered, r * 0.9, layers["i_s"])}


def dark(layers: Mapping[str, np.ndarray], key: str) -> Layers:
    """D a hundredth: nearly all that is seen is specular."""
    lost = 0.99 * layers["d"]
    return {**layers, "d": layers["d"] - lost, "i_t": layers["i_t"] - lost * layers["s_prime"] * (layers["mask"] > 0),
            "i_s": layers["i_s"] - 0.75 * lost}


def unlit(layers: Mapping[str, np.ndarray], key: str) -> Layers:
    """No light at all."""
    return {**layers, "i_t": layers["i_t"] * 0, "s_prime": layers["s_prime"] * 0}


@pytest.mark.parametrize(("change", "every"), [(noisy, 1), (metal, 2), (dark, 2), (unlit, 3)])
def test_hard_but_honest_layers_are_not_refused(honest: dict[str, Example], change: Any, every: int) -> None:
    examples = dict(honest)
    for key in list(honest)[::every]:
        layers = {name: np.maximum(array, 0) for name, array in change(honest[key].layers, key).items()}
        examples[key] = replace(honest[key], layers=layers)
    assert refused(checks(examples.values())) == set()


def test_fog_that_no_layer_tells_of_is_not_judged(honest: dict[str, Example]) -> None:
    fog = FogPlan(extinction=0.2)
    examples = [replace(example, plan=example.plan.model_copy(update={"fog": fog})) for example in honest.values()]
    found = checks(examples)
    assert not any(found[name].judged for name in (*LIGHT, "diffuse_share")) and found["edges"].judged
    air = {"air": np.full((SIZE, SIZE, 3), 0.1, np.float32)}
    found = checks(replace(example, layers={**example.layers, "i_t": example.layers["i_t"] + air["air"], **air})
                   for example in examples)
    assert refused(found) == set() and found["light_slope"].judged and not found["source_slope"].judged


def test_without_a_rough_mask_all_but_drift_is_judged(honest: dict[str, Example]) -> None:
    bare = [replace(example, layers={name: array for name, array in example.layers.items() if name != "mask_rough"})
            for example in honest.values()]
    found = checks(bare)
    assert refused(found) == set() and not found["drift"].judged and found["light_slope"].judged


def test_a_handful_of_examples_is_not_judged_by_its_light(honest: dict[str, Example]) -> None:
    found = checks(list(honest.values())[:4])
    assert not found["energy"].judged and "needs 100 in 6" in found["energy"].detail
    assert not found["edges"].judged and found["support"].judged


def test_tiny_pictures_are_looked_at_as_far_as_they_tell() -> None:
    found = checks(synthetic_example(2 * index, size=20, levels=2) for index in range(10))
    assert refused(found) == set() and not found["edges"].judged


def test_nan_is_no_value_within_bounds() -> None:
    rule = Rule(name="x", statement="", low=0, high=1, why="")
    assert rule.judge(1).holds and not rule.judge(float("nan")).holds and rule.pass_over("none").holds
    assert (rule.bounds, replace(rule, high=np.inf).bounds, replace(rule, low=-np.inf).bounds) == \
        ("0 to 1", ">= 0", "<= 1")


def test_cells_are_means_over_whole_pixels() -> None:
    """One cell of 4x4 pixels; half of one of its columns is outline."""
    assert (cell_side(128, 200), cell_side(20, 20), cell_side(800, 800)) == (8, 4, 16)
    ramp = np.arange(16, dtype=np.float32).reshape(4, 4, 1) * np.ones(3, np.float32)
    layers = {name: ramp for name in ("i_s", "i_t", "s_prime", "d", "r")} | {
        "mask": np.ones((4, 4, 1), np.float32), "mask_rough": np.ones((4, 4, 1), np.float32)}
    layers["mask"][:2, 3] = 0.5
    kept = np.delete(np.arange(16.0), [3, 7])
    cells = cells_of("a", layers, fog=False)
    assert cells.i_t == pytest.approx(np.full((1, 3), kept.mean()))
    assert cells.d_s == pytest.approx(np.full((1, 3), (kept**2).mean()))
    layers["mask"][:, 1:3] = 0
    assert len(cells_of("a", layers, fog=False)) == 0


def test_erosion_keeps_what_is_far_from_an_edge() -> None:
    whole = np.ones((7, 7), bool)
    whole[3, 0] = False
    assert eroded(whole, 2).sum() == 9 - 3 + 0 and not eroded(whole, 2)[2:5, 2].any() and eroded(whole, 0).sum() == 48


def exact(count: int, d_slope: float, s_slope: float) -> list[Cells]:
    """Cells whose logarithms follow a law without noise."""
    made = []
    for number in range(count):
        stream = rng(3, number)
        d, s = np.exp(stream.normal(-1, 0.5, (20, 3))), np.exp(stream.normal(0, 1, (20, 3)))
        made.append(Cells(key=str(number), clear=True, i_s=d, d=d, r=d * 0.01, s_prime=s,
                          i_t=d**d_slope * s**s_slope, d_s=d * s))
    return made


def test_slopes_are_those_of_the_law() -> None:
    found = {check.name: check for check in light_checks(exact(30, 1.0, 1.0))}
    assert found["energy"].value == pytest.approx(0, abs=1e-12) and found["shading"].value == pytest.approx(1, abs=0.2)
    found = {check.name: check for check in light_checks(exact(30, 0.45, 2.2))}
    assert found["albedo_slope"].value == pytest.approx(0.45) and found["light_slope"].value == pytest.approx(2.2)


@pytest.mark.parametrize("shift", [(0, 0), (5, -3), (-12, 12)])
def test_the_place_of_an_outline_is_found(shift: tuple[int, int]) -> None:
    picture = np.full((80, 90, 3), 0.3, np.float32) + 0.01 * rng(4).random((80, 90, 1)).astype(np.float32)
    mask = np.zeros((80, 90))
    mask[30:50, 35:60] = 1
    picture[30 + shift[0]:50 + shift[0], 35 + shift[1]:60 + shift[1]] *= 2
    scores = edge_scores(picture, mask)
    best = np.unravel_index(scores.argmax(), scores.shape)
    assert (best[0] - SEARCH, best[1] - SEARCH) == shift


CAMERA = CameraPlan(position=(0.0, 0.0, 1.0), target=(0.0, 2.0, 1.0), up=(0.0, 0.0, 1.0), fov=90.0, coverage=1.0,
                    visibility=1.0)
PLAN, RECORD = example_plan().model_copy(update={"camera": CAMERA}), render_record(bounding_radius=2.0)


def plane(normal: Sequence[float]) -> Layers:
    """Depth and normals of a plane through the camera's aim."""
    unit = np.asarray(normal) / np.linalg.norm(normal)
    rays = Pinhole.of(CAMERA, 24, 16).unproject(np.ones((16, 24))) - CAMERA.position
    depth = 2 * unit[1] / (rays @ unit)
    return {"mask": np.ones((16, 24, 1)), "depth": depth[..., None], "normal": np.broadcast_to(unit, (16, 24, 3))}


@pytest.mark.parametrize("normal", [(0, -1, 0), (0.3, -1, 0.2), (-0.5, -0.8, 0.6)])
def test_depth_spans_the_surface_that_normals_tell(normal: tuple[float, ...]) -> None:
    assert surface_of(plane(normal), PLAN, RECORD).cosine == pytest.approx(1, abs=1e-6)


def test_wrong_depths_and_normals_are_refused() -> None:
    layers = plane((0.3, -1, 0.2))
    turned = surface_of({**layers, "normal": layers["normal"][..., [0, 2, 1]]}, PLAN, RECORD)
    far = surface_of({**layers, "depth": 1000 * layers["depth"]}, PLAN, RECORD)
    assert [check.name for check in surface_checks([turned]) if not check.holds] == ["normals"]
    assert [check.name for check in surface_checks([far]) if not check.holds] == ["depth"]
    assert not any(check.judged for check in surface_checks([surface_of({"mask": layers["mask"]}, PLAN, RECORD)]))
