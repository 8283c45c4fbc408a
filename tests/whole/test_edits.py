"""An edit runs the passes that it touches and no other, and ends with the bytes of a build from nothing.

The cases are the rows of the table in docs/editing.md, and every number there is held to what happens here.
"""

import re
import shutil
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from dataset_builder.builder import build
from dataset_builder.cli.main import main
from dataset_builder.engine.against import GONE, NEW, Against, against
from dataset_builder.engine.unit import BuildJob
from dataset_builder.planning.plan import Planner
from dataset_builder.rendering.pass_inputs import RUNS
from dataset_builder.shards.verify import verify
from dataset_builder.spec.load import load_dataset
from tests.small_specs import contents, write_spec

PAGE = Path(__file__).parents[2] / "docs" / "editing.md"
SPEC = """\
name: small
seed: 1
image: {width: 12, height: 10}
layers: {i_s: frame, i_t: frame, d: object, r: object, s_prime: object, mask: object, mask_rough: object}
render: {spp: 8, max_depth: 3}
rough: {sigma: [0.0, 0.006], edge_length: 0.4, rounds: 0}
gates: {mask_overlap: 0.1}
camera: {azimuth: {uniform: [-180, 180]}, elevation: {uniform: [10, 40]}, coverage: [0.1, 0.5]}
target: {kinds: [sphere]}
storage: {examples_per_shard: 3}
splits:
  - name: train
    objects: {count: 2, from: [objects/cabinet.yaml, objects/nightstand.yaml]}
    scenes: {count: 1, from: [scenes/den.yaml]}
  - name: test
    objects: {count: 1, from: [objects/ottoman.yaml]}
    scenes: {count: 1, from: [scenes/attic.yaml]}
"""
FILES = {"small.yaml": SPEC, "scenes/attic.yaml": "room: ../rooms/attic.yaml\n",
         "rooms/attic.yaml": "width: 4\ndepth: 4\nheight: 2.6\nwindows: 1\n", "objects/bench.yaml": "family: bench\n"}
"""Six examples: two training views and one test view, each at two noise levels."""

MORE = """\
  - name: extra
    objects: {count: 1, from: [objects/bench.yaml]}
    scenes: {count: 1, from: [scenes/spare.yaml]}
"""
SPARE = {"scenes/spare.yaml": "room: ../rooms/spare.yaml\n", "rooms/spare.yaml": "width: 5\ndepth: 4\nheight: 2.6\n"}
GOAL = "render.accuracy={i_t: {error: 0.9, cap: 256}}"
VIEWS, EXAMPLES = 3, 6
ALL = {"first_hit": VIEWS, "source": VIEWS, "target": VIEWS, "lighting": VIEWS, "first_hit_rough": EXAMPLES,
       "rough": EXAMPLES}
LIGHT = {"target": VIEWS, "lighting": VIEWS, "first_hit_rough": EXAMPLES, "rough": EXAMPLES}
ONE_VIEW = {"first_hit": 1, "source": 1, "target": 1, "lighting": 1, "first_hit_rough": 2, "rough": 2}


@dataclass(frozen=True, kw_only=True)
class Edit:
    """A change of the spec, and the passes that have to run."""

    runs: Mapping[str, int]
    overrides: tuple[str, ...] = ()
    files: Mapping[str, str] = field(default_factory=dict)
    before: tuple[str, ...] = ()
    """Overrides of the dataset that is edited."""


EDITS = {
    "title, description": Edit(runs={}, overrides=("title=Other", "description=Other words.")),
    "a split added": Edit(runs={**ONE_VIEW}, files={"small.yaml": SPEC + MORE, **SPARE}),
    "views added": Edit(runs={name: 2 * count for name, count in ONE_VIEW.items()},
                        overrides=("splits.train.views=2",)),
    "a noise level added": Edit(runs={"first_hit_rough": VIEWS, "rough": VIEWS},
                                overrides=("rough.sigma=[0.0, 0.006, 0.01]",)),
    "a layer added": Edit(runs={}, overrides=("layers.s=object",)),
    "standard errors added": Edit(runs={}, overrides=("storage.standard_errors=true",)),
    "a layer removed": Edit(runs={}, overrides=("layers={i_s: frame, i_t: frame, d: object, s_prime: object, "
                                                "mask: object}",)),
    "pixel type": Edit(runs={}, overrides=("storage.dtype=float16",)),
    "examples per shard": Edit(runs={}, overrides=("storage.examples_per_shard=2",)),
    "shared members stored once": Edit(runs={}, overrides=("storage.shared=once",)),
    "shared members stored by each": Edit(runs={}, before=("storage.shared=once",)),
    "gates": Edit(runs={}, overrides=("gates.coverage=[0.011, 0.95]",)),
    "strength of the target light": Edit(runs=LIGHT, overrides=("target.strength=3",)),
    "colour of the target light": Edit(runs=LIGHT, overrides=("target.temperature=3000",)),
    "kind of the target light": Edit(runs=LIGHT, overrides=("target.kinds=[area]",)),
    "camera": Edit(runs=dict(ALL, lighting=1), overrides=("camera.fov=40",)),
    "material of one object": Edit(runs=ONE_VIEW, files={
        "objects/cabinet.yaml": "family: cabinet\nmaterials: {'*': {roughness: 0.9}}\n"}),
    "furniture of one scene": Edit(runs=ONE_VIEW, files={
        "scenes/attic.yaml": "room: ../rooms/attic.yaml\nfurniture: [{object: ../objects/stool.yaml, place: wall}]\n"}),
    "another number of samples": Edit(runs=dict(ALL, lighting=0), overrides=("render.spp=16",)),
    "samples appended": Edit(runs={"target": VIEWS}, overrides=(
        "render.spp={first_hit: 8, source: 8, target: [8, 8], rough: 8}",)),
    "a tighter goal appended": Edit(runs={"target": VIEWS}, before=(GOAL,), overrides=(
        "render.accuracy={i_t: [{error: 0.9, cap: 256}, {error: 0.45, cap: 256}]}",)),
}


def run(spec: Path, folder: Path, *overrides: str) -> tuple[Counter[str], Counter[str], int]:
    """Passes that ran and that were recalled, and paths that were traced."""
    ran, recalled, paths = Counter[str](), Counter[str](), 0
    for event in build(load_dataset(spec, overrides), folder, backend="llvm", workers=1):
        for outcome in event.outcomes:
            ran.update(name for name in outcome.seconds if name in RUNS)
            recalled.update(outcome.recalled)
            paths += outcome.paths
    return ran, recalled, paths


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Folder of a finished dataset with overrides, to be copied before it is edited."""
    known: dict[tuple[str, ...], Path] = {}
    spec = write_spec(tmp_path_factory.mktemp("spec"), FILES)

    def make(*overrides: str) -> Path:
        if overrides not in known:
            known[overrides] = tmp_path_factory.mktemp("built") / "small"
            run(spec, known[overrides], *overrides)
        return known[overrides]
    return make


def edited(built: Callable[..., Path], edit: Edit, folder: Path) -> tuple[Path, Path]:
    """The spec after an edit, and a copy of the dataset before it."""
    shutil.copytree(built(*edit.before), folder / "small")
    return write_spec(folder / "spec", {**FILES, **edit.files}), folder / "small"


def compared(spec: Path, folder: Path, *overrides: str) -> Against:
    loaded = load_dataset(spec, overrides)
    return against(Planner(loaded), folder, BuildJob.of(loaded, folder, backend="llvm", threads=1))


@pytest.mark.parametrize("what", EDITS)
def test_an_edit_runs_what_it_touches(what: str, built: Callable[..., Path], tmp_path: Path) -> None:
    edit = EDITS[what]
    spec, folder = edited(built, edit, tmp_path)
    said = compared(spec, folder, *edit.overrides)
    ran, _, _ = run(spec, folder, *edit.overrides)
    fresh, nothing, _ = run(spec, tmp_path / "fresh", *edit.overrides)
    assert dict(ran) == {name: count for name, count in edit.runs.items() if count}
    assert {name: passes.runs for name, passes in said.passes.items() if passes.runs} == dict(ran)
    assert not nothing and sum(fresh.values()) == sum(passes.total for passes in said.passes.values())
    assert contents(folder) == contents(tmp_path / "fresh") and verify(folder) == []
    assert table()[what] == (sum(ran.values()), sum(fresh.values()))


def table() -> dict[str, tuple[int, int]]:
    """Runs and runs from nothing by edit, as the page has them."""
    rows = re.findall(r"^\| ([^|]+) \| (\d+) of (\d+) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    return {what: (int(runs), int(of)) for what, runs, of in rows}


def test_the_page_has_every_edit_and_no_other() -> None:
    assert list(table()) == list(EDITS)


def test_a_title_touches_no_shard(built: Callable[..., Path], tmp_path: Path) -> None:
    spec, folder = edited(built, EDITS["title, description"], tmp_path)
    before = {path.name: path.stat().st_mtime_ns for path in (folder / "shards").iterdir()}
    run(spec, folder, *EDITS["title, description"].overrides)
    assert {path.name: path.stat().st_mtime_ns for path in (folder / "shards").iterdir()} == before
    assert "Other words." in (folder / "README.md").read_text()


def test_appended_samples_are_the_only_ones_taken(built: Callable[..., Path], tmp_path: Path) -> None:
    edit = EDITS["samples appended"]
    spec, folder = edited(built, edit, tmp_path)
    _, _, paths = run(spec, folder, *edit.overrides)
    assert paths == 2 * VIEWS * 12 * 10 * 8


def test_without_a_cache_everything_runs_again_to_the_same_bytes(built: Callable[..., Path], tmp_path: Path) -> None:
    edit = EDITS["pixel type"]
    spec, folder = edited(built, edit, tmp_path)
    shutil.rmtree(folder / ".build" / "passes")
    said = compared(spec, folder, *edit.overrides)
    assert {name: passes.runs for name, passes in said.passes.items()} == ALL
    assert all(set(passes.changed) == {GONE} for passes in said.passes.values())
    ran, _, _ = run(spec, folder, *edit.overrides)
    assert dict(ran) == ALL


@pytest.mark.parametrize("what", ["shared members stored once", "shared members stored by each"])
def test_published_examples_are_taken_over_without_a_cache(what: str, built: Callable[..., Path],
                                                           tmp_path: Path) -> None:
    edit = EDITS[what]
    spec, folder = edited(built, edit, tmp_path)
    shutil.rmtree(folder / ".build" / "passes")
    ran, recalled, _ = run(spec, folder, *edit.overrides)
    assert not ran and not recalled
    assert contents(folder) == contents(built(*edit.overrides)) and contents(folder) != contents(built(*edit.before))


@pytest.mark.parametrize(("what", "topics"), [
    ("strength of the target light", {"target light"}), ("camera", {"camera"}), ("views added", {NEW}),
    ("material of one object", {"object"}), ("furniture of one scene", {"furniture"}),
    ("samples appended", {"samples"})])
def test_what_changed_is_told_in_words(what: str, topics: set[str], built: Callable[..., Path], tmp_path: Path) -> None:
    spec, folder = edited(built, EDITS[what], tmp_path)
    said = compared(spec, folder, *EDITS[what].overrides)
    assert topics <= {topic for passes in said.passes.values() for topic in passes.changed}


def test_the_verb_says_what_would_run(built: Callable[..., Path], tmp_path: Path,
                                      capsys: pytest.CaptureFixture[str]) -> None:
    spec, folder = edited(built, EDITS["title, description"], tmp_path)
    assert main(["plan", str(spec), "--against", str(folder), "--set", "target.strength=3", "--backend", "llvm"]) == 0
    printed = capsys.readouterr().out
    assert "0 of 6 examples are published as they are" in printed
    assert re.search(r"target\s+│\s+3\s+│\s+3\s+│\s+target light \(3\)", printed)
    assert main(["build", str(spec), "--out", str(folder), "--set", "target.strength=3", "--backend", "llvm",
                 "--workers", "1", "--cache-size", "0.5"]) == 0
    assert "passes: 18 ran, 6 were known from an earlier build; " in capsys.readouterr().out


@pytest.mark.parametrize("override", ["name=other", "version=2.0.0"])
def test_a_dataset_that_a_build_refuses_is_not_compared_with(override: str, built: Callable[..., Path], tmp_path: Path,
                                                             capsys: pytest.CaptureFixture[str]) -> None:
    spec, folder = edited(built, EDITS["title, description"], tmp_path)
    assert main(["plan", str(spec), "--against", str(folder), "--set", override, "--backend", "llvm"]) == 2
    assert "got the dataset small" in capsys.readouterr().err


@pytest.mark.parametrize(("options", "message"), [
    (("--cache", ""), "empty name"), (("--cache-size", "1e300"), "expected GB from 0"),
    (("--cache-size", "nan"), "expected GB from 0"), (("--cache-size", "-1"), "expected GB from 0")])
def test_wrong_caches_are_refused(options: tuple[str, str], message: str, tmp_path: Path,
                                  capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["build", str(write_spec(tmp_path, FILES)), *options])
    assert message in capsys.readouterr().err
