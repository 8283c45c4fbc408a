"""What `import dataset_builder as db` offers, what it costs to import, and that it makes what a build makes."""

import ast
import subprocess
import sys
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dataset_builder as db
from dataset_builder.engine.source import read_sources
from dataset_builder.shards.reader import load_manifest
from tests.small_specs import contents

READER = {"numpy", "OpenEXR", "pydantic", "pydantic_core", "annotated_types", "typing_extensions", "typing_inspection"}
"""NumPy, OpenEXR, pydantic and what pydantic is made of."""

ONLY = f"""
import sys
class Only:
    def find_spec(self, name, path=None, target=None):
        top = name.partition(".")[0]
        known = {{*sys.stdlib_module_names, "dataset_builder", *{sorted(READER)}, *sys.argv[1:]}}
        # That part of the standard library is named after the platform
        if top not in known and not top.startswith("_sysconfigdata"):
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Only())
"""
"""Lets a script import the standard library, this package, what a reader needs, and what its arguments name."""


def run(script: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The script in a process of its own, in the repository's root."""
    return subprocess.run([sys.executable, "-c", script, *arguments], capture_output=True, text=True, check=False,
                          cwd=Path(__file__).parent.parent)


@pytest.fixture(scope="module")
def spec(small_spec: Path) -> db.LoadedSpec:
    return db.load_spec(small_spec)


@pytest.fixture(scope="module")
def plan(spec: db.LoadedSpec) -> db.ExamplePlan:
    """Of an example that the target light has lit."""
    return db.plan(spec, 3)


@pytest.fixture(scope="module")
def rendered(spec: db.LoadedSpec, plan: db.ExamplePlan) -> dict[str, Any]:
    return db.render_example(spec, plan, backend="llvm")


def same(one: Mapping[str, Any], other: Mapping[str, Any]) -> set[str]:
    """Names of what two examples have in common, bit for bit."""
    return {name for name in one if (one[name] == other[name] if name == "meta" else
                                     one[name].tobytes() == other[name].tobytes())}


# Importing


def test_importing_loads_nothing_else() -> None:
    script = ("import sys, time\nbefore = set(sys.modules)\nstart = time.process_time()\nimport dataset_builder as db\n"
              "print(time.process_time() - start, *{name.partition('.')[0] for name in set(sys.modules) - before"
              "} - sys.stdlib_module_names, len(dir(db)))")
    seconds, *loaded, names = run(script).stdout.split()
    assert float(seconds) < 0.2 and loaded == ["dataset_builder"] and int(names) == len(db.__all__) + 1


def test_reading_needs_three_libraries(small_dataset: Path) -> None:
    script = (f"{ONLY}\nimport dataset_builder as db\nexample = db.open_dataset({str(small_dataset)!r})['test', 0]\n"
              "print(example['i_t'].shape, example['meta']['split'])")
    done = run(script)
    assert done.stdout == "(20, 24, 3) test\n", done.stderr


def test_verifying_needs_pillow_besides(small_dataset: Path) -> None:
    script = f"{ONLY}\nimport dataset_builder as db\nprint(db.verify({str(small_dataset)!r}))"
    assert run(script, "PIL").stdout == "[]\n"
    assert "No module named 'PIL'" in run(script).stderr


@pytest.mark.parametrize("use", ["load_spec('none.yaml')", "LightingDataset"])
def test_what_is_missing_is_named(use: str) -> None:
    done = run(f"{ONLY}\nimport dataset_builder as db\n"
               f"try:\n    db.{use}\nexcept db.UserError as error:\n    print(error)")
    assert 'which is not installed; pip install "3df-lighting-builder[' in done.stdout, done.stderr


def test_every_name_is_there_and_type_checkers_know_it() -> None:
    tree = ast.parse(read_sources()[""])
    block = next(node for node in tree.body if isinstance(node, ast.If))
    told = {alias.asname: f"{node.module}.{alias.name}" for node in block.body if isinstance(node, ast.ImportFrom)
            for alias in node.names}
    assert sorted(told) == sorted(db.__all__) and set(db.__all__) < set(dir(db))
    assert all(f"{getattr(db, name).__module__}.{name}" == home for name, home in told.items())


def test_other_names_are_not_there() -> None:
    with pytest.raises(AttributeError, match="'dataset_builder' has no attribute 'bild'"):
        db.bild  # type: ignore[attr-defined]  # noqa: B018


# Rendering


@pytest.mark.parametrize("example", [0, 3, 9])
def test_an_example_in_memory_is_the_one_that_a_build_makes(spec: db.LoadedSpec, small_dataset: Path,
                                                             example: int) -> None:
    built = db.open_dataset(small_dataset)[f"{example:08}"]
    assert same(db.render_example(spec, example, backend="llvm"), built) == set(built)


def test_layers_are_rounded_as_they_are_stored(small_spec: Path, rendered: dict[str, Any]) -> None:
    half = db.render_example(db.load_spec(small_spec, ["storage.dtype=float16"]), 3, backend="llvm")
    assert np.array_equal(half["i_t"], rendered["i_t"].astype(np.float16).astype(np.float32))
    assert not np.array_equal(half["i_t"], rendered["i_t"])


def test_the_same_plan_gives_the_same_pixels_and_nothing_is_kept(spec: db.LoadedSpec, plan: db.ExamplePlan,
                                                                 rendered: dict[str, Any]) -> None:
    import drjit as dr

    live = []
    for _ in range(3):
        assert same(db.render_example(spec, plan, backend="llvm"), rendered) == set(rendered)
        live.append(len(dr.whos(as_string=True).splitlines()))
    assert live[0] == live[1] == live[2]


def lit(plan: db.ExamplePlan, factor: float = 1, **lamp: object) -> db.ExamplePlan:
    """The plan with all target lights as many times as bright, and the first of them changed."""
    lights = [light.model_copy(update={"radiance": tuple(factor * value for value in light.radiance)})
              for light in plan.target_light.lights]
    lights[0] = lights[0].model_copy(update=lamp)
    return plan.model_copy(update={"target_light": plan.target_light.model_copy(update={"lights": tuple(lights)})})


def test_a_light_can_be_changed(spec: db.LoadedSpec, plan: db.ExamplePlan, rendered: dict[str, Any]) -> None:
    brighter = db.render_example(spec, lit(plan, 2), backend="llvm")
    moved = db.render_example(spec, lit(plan, position=(0.0, 0.0, 2.2)), backend="llvm")
    np.testing.assert_allclose(brighter["i_t"], 2 * rendered["i_t"], rtol=1e-5, atol=1e-6)
    unlit = {"i_s", "d", "r", "mask", "mask_rough", "depth", "normal", "normal_rough", "instance"}
    assert same(moved, rendered) == same(brighter, rendered) == unlit
    assert brighter["meta"]["plan"] == lit(plan, 2).model_dump(mode="json")
    assert same(db.render_example(spec, plan, backend="llvm"), rendered) == set(rendered)


def test_an_example_that_is_not_there(spec: db.LoadedSpec) -> None:
    for make in (db.plan, db.render_example):
        with pytest.raises(db.UserError, match=r"expected an example in \[0, 10\), got 10"):
            make(spec, 10)


# Building


def test_a_build_runs_to_its_end_and_goes_on(small_spec: Path, small_dataset: Path, tmp_path: Path) -> None:
    """Of a spec with overrides, which the processes of the build must find again."""
    spec = db.load_spec(small_spec, ("splits.train.lights=1", "splits.train.objects.count=1"))
    told: list[tuple[int, int]] = []
    assert db.build(spec, tmp_path, workers=1, backend="llvm", examples=[1, 3]) is None
    manifest = db.build(spec, tmp_path, workers=1, backend="llvm", progress=lambda *counts: told.append(counts))
    assert manifest is not None and manifest.totals.examples == 4 and db.verify(tmp_path) == []
    assert told[0] == (0, 4) and told[-1] == (4, 4) and told == sorted(told)
    assert db.build(spec, tmp_path, workers=1, backend="llvm") == load_manifest(tmp_path)


def test_a_dataset_lies_where_the_command_puts_it(spec: db.LoadedSpec, small_dataset: Path, tmp_path: Path,
                                                  monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    db.build(spec, workers=1, backend="llvm")
    assert contents(tmp_path / "datasets" / "small") == contents(small_dataset)


def test_tone_mapped_images_share_an_exposure() -> None:
    dim, bright = np.full((4, 5, 3), 0.5, np.float32), np.full((4, 2, 1), 2.0, np.float32)
    picture = db.tone_mapped(dim, bright)
    assert picture.shape == (4, 7, 3) and picture.dtype == np.uint8
    # sRGB of 0.25 and of 1
    assert (picture[:, :5] == 137).all() and (picture[:, 5:] == 255).all()


def test_threads_render_one_at_a_time(spec: db.LoadedSpec) -> None:
    """Scenes of two threads would take each other's places: Dr.Jit ends the process."""
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(lambda index: db.render_example(spec, index, backend="llvm"), (0, 3, 0)))
    assert np.array_equal(found[0]["i_t"], found[2]["i_t"]) and not np.array_equal(found[0]["i_t"], found[1]["i_t"])
