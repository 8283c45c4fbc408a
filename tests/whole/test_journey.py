"""A number's way from the spec to the pixels: what depends on it follows, all else stays as it was, bit by bit."""

import json
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.cli.main import main
from dataset_builder.rendering import passes
from dataset_builder.rendering.backend import activate
from dataset_builder.shards.folder import STAGING, WORK
from dataset_builder.shards.reader import open_dataset
from tests.small_specs import FILES, VIEW, outcomes_of, records, run_build, write_spec

LIGHT_FREE = {"d", "r", "mask", "depth", "normal", "instance"}
OF_THE_ROUGH_MESH = {"mask_rough", "normal_rough"}
LIT = {"i_s", "i_t", "s", "spec", "s_prime"}
SPP = "  spp: {first_hit: 16, source: 16, target: 16, rough: 16}\n"
EVERYTHING = LIGHT_FREE | OF_THE_ROUGH_MESH | LIT


def shipped(folder: Path, key: str) -> dict[str, str]:
    """Pixel digests by layer of an example of a finished dataset."""
    return by_layer([member.model_dump() for member in records(folder)[key].members])


def by_layer(members: list[dict[str, Any]]) -> dict[str, str]:
    """Pixel digest by layer."""
    return {member["name"].split(".")[1]: member["pixel_digest"]
            for member in members if member["name"].endswith("exr")}


def staged(folder: Path, key: str) -> tuple[dict[str, str], dict[str, Any]]:
    """Pixel digests by layer, and the label, of an example that waits for its shard."""
    path, = (folder / WORK / STAGING).glob(f"{key}.*.json")
    entry, segment = json.loads(path.read_bytes())["entry"], path.with_suffix(".segment").read_bytes()
    start = segment.index(b'{"index":')
    return by_layer(entry["members"]), json.loads(segment[start:segment.index(b"\n", start)])


def changed(first: Mapping[str, str], other: Mapping[str, str]) -> set[str]:
    """Layers whose pixels differ."""
    assert set(first) == set(other) == EVERYTHING
    return {name for name in first if first[name] != other[name]}


def paths_that_differ(one: Any, other: Any, path: str = "") -> set[str]:
    """Dotted paths at which two labels differ."""
    if isinstance(one, dict) and isinstance(other, dict):
        keys = one.keys() | other.keys()
        return {found for key in keys for found in paths_that_differ(one.get(key), other.get(key), f"{path}.{key}")}
    return set() if one == other else {path.lstrip(".")}


def test_sigma_in_yaml(small_dataset: Path, tmp_path: Path) -> None:
    spec = write_spec(tmp_path, {"small.yaml": FILES["small.yaml"].replace("[0.0, 0.006]", "[0.0, 0.012]")})
    run_build(spec, tmp_path / "out", only=VIEW[:2])
    label = open_dataset(small_dataset, layers=())["00000001"]["meta"]
    same, other = staged(tmp_path / "out", "00000000"), staged(tmp_path / "out", "00000001")
    assert changed(shipped(small_dataset, "00000000"), same[0]) == set()
    assert changed(shipped(small_dataset, "00000001"), other[0]) == {"s_prime"} | OF_THE_ROUGH_MESH
    assert other[1]["plan"]["rough"]["sigma"] == 0.012
    assert paths_that_differ(label["plan"], other[1]["plan"]) == {"rough.sigma"}
    assert other[1]["record"]["roughness_rms"] == pytest.approx(2 * label["record"]["roughness_rms"], rel=0.2)


@pytest.mark.parametrize(("override", "must", "may", "plan"), [
    # Reasons tell the error of caustics at the samples asked for
    ("render.spp.target=32", {"i_t", "s", "spec"}, set(), {"render.spp_target", "effects.decisions"}),
    # Light on the object is traced where the light-free passes found it
    ("render.spp.first_hit=32", (LIGHT_FREE | OF_THE_ROUGH_MESH) - {"instance"}, {"s", "spec", "s_prime"},
     {"render.spp_first_hit"}),
    ("render.max_depth=2", LIT, set(), {"effects.decisions", "effects.passes"}),
    # Target lights are as strong as the source says
    ("source.dome=2", {"i_s"}, {"i_t", "s", "spec", "s_prime"},
     {"source_light.lights", "target_light.lights", "effects.decisions"}),
    ("gates.coverage=[0.02, 0.9]", set(), set(), set()),
])
def test_an_override(small_spec: Path, small_dataset: Path, tmp_path: Path, override: str, must: set[str],
                     may: set[str], plan: set[str]) -> None:
    run_build(write_spec(tmp_path, {"small.yaml": FILES["small.yaml"].replace("  spp: 16\n", SPP)}), tmp_path / "out",
              override, only=[1])
    found, label = staged(tmp_path / "out", "00000001")
    before = open_dataset(small_dataset, layers=())["00000001"]["meta"]
    different = changed(shipped(small_dataset, "00000001"), found)
    assert must <= different <= must | may
    assert paths_that_differ(before["plan"], label["plan"]) == plan
    if override.startswith("render.spp"):
        name = override.split(".")[2].split("=")[0]
        assert {entry["name"]: entry["spp"] for entry in label["record"]["passes"]}[name] == 32


def test_the_plan_says_what_the_label_says(small_spec: Path, small_dataset: Path,
                                           capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(small_spec), "--example", "7"]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert plan == open_dataset(small_dataset, layers=())["00000007"]["meta"]["plan"]


def test_examples_of_a_view_share_what_they_can(small_dataset: Path) -> None:
    dark, rough, other, both = (shipped(small_dataset, f"{index:08d}") for index in VIEW)
    shaped = {"s_prime"} | OF_THE_ROUGH_MESH
    lit = {"i_t", "s", "spec", "s_prime"}
    assert changed(dark, rough) == changed(other, both) == shaped
    assert changed(dark, other) == changed(rough, both) == lit
    assert changed(dark, both) == lit | shaped


def test_another_light_moves_no_other_draw(small_spec: Path, small_dataset: Path, tmp_path: Path) -> None:
    run_build(small_spec, tmp_path, "splits.train.lights=1", only=[0, 1, 2])
    for alone, key in (("00000000", "00000000"), ("00000001", "00000001"), ("00000002", "00000004")):
        assert changed(staged(tmp_path, alone)[0], shipped(small_dataset, key)) == set()


def counted(name: str, run: Callable[..., Any], calls: Counter[str]) -> Callable[..., Any]:
    """`run`, whose calls are counted."""
    def wrapped(*arguments: Any, **options: Any) -> Any:
        calls[name] += 1
        return run(*arguments, **options)
    return wrapped


def test_passes_are_not_repeated(small_spec: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    activate("llvm")
    calls = Counter[str]()
    for name in ("first_hit", "radiance_sampler", "instances"):
        monkeypatch.setattr(passes, name, counted(name, getattr(passes, name), calls))
    outcomes = outcomes_of(run_build(small_spec, tmp_path, only=VIEW))
    # The clean mesh, and both rough ones under both lights; source, two targets, and both levels under both
    assert calls == {"first_hit": 1 + 2 * 2, "instances": 1, "radiance_sampler": 1 + 2 + 2 * 2}
    needed = [set(outcomes[index].seconds) - {"plan", "encode"} for index in VIEW]
    assert needed == [{"source", "target", "first_hit", "first_hit_rough", "rough", "instance", "lighting"},
                      {"first_hit_rough", "rough"}, {"first_hit_rough", "target", "rough", "lighting"},
                      {"first_hit_rough", "rough"}]
    assert ["plan" in outcomes[index].seconds for index in VIEW] == [True, False, False, False]


def test_the_layers_mean_what_they_say(small_dataset: Path) -> None:
    for example in open_dataset(small_dataset):
        covered, either = example["mask"] > 0, (example["mask"] > 0) | (example["mask_rough"] > 0)
        for name in ("d", "r", "s", "spec", "normal"):
            assert not np.any(example[name][~covered[..., 0]]) and np.any(example[name])
        for name in ("s_prime", "normal_rough", "mask_rough"):
            assert not np.any(example[name][~either[..., 0]]) and np.any(example[name])
        for name in ("i_s", "i_t", "depth"):
            assert np.mean(example[name].max(axis=2)[~covered[..., 0]] > 0) > 0.9
        assert set(np.unique(example["instance"])) >= {1, 2} and example["instance"].max() <= 3
        assert example["mask"][example["instance"] == 1].min() > 0
