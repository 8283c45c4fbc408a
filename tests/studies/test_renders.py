"""References are rendered once: again only for another plan or other versions."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dataset_builder.studies import renders as module
from dataset_builder.studies.renders import References, pixel_versions
from dataset_builder.studies.sampled import reseeded
from tests.plans import example_plan

LAYERS = {"i_t": np.arange(6, dtype=np.float32).reshape(1, 2, 3), "mask": np.ones((1, 2, 1), dtype=np.float32)}


@pytest.fixture
def renders(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Seeds of the plans that were rendered, in order; rendering itself takes no time."""
    seeds: list[str] = []

    def render(plan: Any, mesh_root: Path) -> SimpleNamespace:
        seeds.append(plan.render.seed)
        return SimpleNamespace(layers=LAYERS)

    monkeypatch.setattr(module, "render", render)
    return seeds


def test_the_second_time_it_is_read(tmp_path: Path, renders: list[str]) -> None:
    cache, plan = References(folder=tmp_path, made_by={"mitsuba": "3"}), example_plan()
    first, second = cache.get(plan, tmp_path), cache.get(plan, tmp_path)
    assert len(renders) == 1
    for found in (first, second):
        assert {name: image.tolist() for name, image in found.items()} == {
            name: image.tolist() for name, image in LAYERS.items()}


def test_other_versions_plans_and_damage_are_rendered_anew(tmp_path: Path, renders: list[str]) -> None:
    cache, plan = References(folder=tmp_path, made_by={"mitsuba": "3"}), example_plan()
    cache.get(plan, tmp_path)
    replace(cache, made_by={"mitsuba": "4"}).get(plan, tmp_path)
    cache.get(reseeded(plan, "other"), tmp_path)
    assert len(renders) == 3
    cache.path(plan).write_bytes(cache.path(plan).read_bytes()[:100])
    assert [len(renders) for _ in range(2) if cache.get(plan, tmp_path)] == [4, 4]


def test_other_samples_change_nothing_but_the_seed() -> None:
    plan = example_plan()
    one, two = reseeded(plan, "reference"), reseeded(plan, "replicate", 0)
    assert len({plan.render.seed, one.render.seed, two.render.seed}) == 3
    same = one.model_copy(update={"render": plan.render})
    assert same == plan and reseeded(plan, "reference") == one


def test_versions_know_what_makes_pixels() -> None:
    found = pixel_versions("llvm")
    assert {"mitsuba", "drjit", "variant", "open3d", "source"} <= set(found)
