"""A sequence from its spec to its shards: views in order, one light, gaps that say why."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.geometry.reprojection import View, correspond
from dataset_builder.shards.reader import Dataset, open_dataset
from tests.small_specs import FILES, contents, run_build, write_spec

TURN = """\
  - name: test
    objects: {count: 1, from: [objects/ottoman.yaml]}
    scenes: {count: 1, from: [scenes/den.yaml]}
    views: 8
    lights_per: pair
    camera: {path: {kind: orbit, elevation: [5, 85], azimuth: 0}, fov: 70, coverage: [0.02, 0.6], visibility: 0.5}
"""
SCENE = """\
room: ../rooms/den.yaml
furniture:
  - {object: ../objects/stool.yaml, place: near}
  - {object: ../objects/cabinet.yaml, place: near}
"""


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small dataset with a sequence for its test split, in a room where furniture stands close by."""
    text = FILES["small.yaml"]
    turning = text[:text.index("  - name: test")] + TURN
    turning = turning.replace("sigma: [0.0, 0.006]", "sigma: 0.004").replace("    lights: 2\n", "")
    return write_spec(tmp_path_factory.mktemp("spec"), {
        "small.yaml": turning, "scenes/den.yaml": SCENE})


@pytest.fixture(scope="module")
def folder(spec: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The dataset; not to be changed."""
    folder = tmp_path_factory.mktemp("built") / "small"
    run_build(spec, folder, "image={width: 48, height: 48}")
    return folder


def view_of(dataset: Dataset, key: str) -> View:
    found, plan = dataset[key], dataset.label(key).plan
    return View(camera=Pinhole.of(plan.camera, 48, 48), depth=found["depth"][..., 0],
                inside=found["mask"][..., 0] >= 0.5)


def test_views_are_in_order_in_one_light_and_gaps_say_why(folder: Path) -> None:
    dataset = open_dataset(folder)
    keys = dataset.splits["test"]
    plans = [dataset.label(key).plan for key in keys]
    frames = [plan.sequence.frame for plan in plans]
    lost = [item for item in dataset.manifest.rejected if item.view.startswith("test/")]
    assert frames == sorted(frames) and len(frames) + len(lost) == 8 and len(frames) >= 3
    assert {plan.sequence.name for plan in plans} == {"test-00-00"} and {plan.sequence.frames for plan in plans} == {8}
    assert len({(plan.source_light, plan.target_light, plan.camera.fov) for plan in plans}) == 1
    elevations = [plan.camera.position[2] for plan in plans]
    assert elevations == sorted(elevations)
    away = [np.linalg.norm(np.subtract(plan.camera.position, plan.camera.target)) for plan in plans]
    assert away == pytest.approx([away[0]] * len(away))
    for item in lost:
        place = int(item.view.removeprefix("test/"))
        assert place not in frames and f"expected view {place} of the orbit" in item.reason


def test_rendered_neighbours_are_the_same_surface(folder: Path) -> None:
    """D is the same from all sides, so that what is left is noise, texels and what pixels average over."""
    dataset = open_dataset(folder)
    keys = dataset.splits["test"]
    frames = [dataset.label(key).plan.sequence.frame for key in keys]
    left = []
    for (before, now), (a, b) in zip(pairwise(keys), pairwise(frames), strict=True):
        if b == a + 1:
            both = correspond(view_of(dataset, before), view_of(dataset, now))
            here, there = both.here(dataset[before]["d"]), both.there(dataset[now]["d"])
            left.append(float(np.abs(here - there).mean() / here.mean()) if len(here) else 0.0)
            assert both.pixels.any()
    assert left and max(left) < 0.1


def test_a_second_build_is_the_same(spec: Path, folder: Path, tmp_path: Path) -> None:
    run_build(spec, tmp_path / "again", "image={width: 48, height: 48}")
    assert contents(tmp_path / "again") == contents(folder)
