"""A dataset in parts, each built in a folder of its own, and merged: the bytes of one build, or a reason."""

import json
import re
import shutil
from collections.abc import Callable, Iterator, Sequence
from itertools import zip_longest
from pathlib import Path

import pytest

from dataset_builder.builder import Event, build
from dataset_builder.cli.main import main
from dataset_builder.digest import sealed, unsealed
from dataset_builder.engine.dataset_part import DatasetPart, read_record
from dataset_builder.errors import OutputError, UserError
from dataset_builder.merge import merge
from dataset_builder.planning.plan import Planner
from dataset_builder.rendering import oidn
from dataset_builder.shards.folder import WORK
from dataset_builder.shards.reader import load_manifest
from dataset_builder.shards.verify import verify
from dataset_builder.spec.load import load_dataset
from tests.small_specs import contents, outcomes_of, run_build, write_spec

QUICK = ("rough.sigma=[0.0, 0.002, 0.08]", "gates.mask_overlap=0.8", "splits.train.lights=1", "render.spp=4")
"""Nine examples of three views, one view a part; the last of each view is rejected."""
SEEN = ("layers={i_s: object, i_t: frame, s_prime: object, mask: object, mask_field: object}", "rough.sigma=0.0",
        "splits.test.source={kind: field, views: 8, held_out: 2, size: 16, spp: 4, resolution: 32, steps: 10, "
        "gates: {psnr: 1, opacity_iou: 0}}", "splits.train.lights=1", "splits.test.views=3", "render.spp=4",
        "render.denoise={layers: [i_t], examples: 1}")
"""Five examples; those of the test split are seen through one field, and all are denoised."""

try:
    oidn.require()
    MISSING = ""
except UserError as error:
    MISSING = str(error)
needs_oidn = pytest.mark.skipif(bool(MISSING), reason=f"Open Image Denoise: {MISSING}")


def part_events(spec: Path, folder: Path, text: str, *overrides: str) -> Iterator[Event]:
    return build(load_dataset(spec, overrides), folder, backend="llvm", workers=1, part=DatasetPart.parse(text))


def build_part(spec: Path, folder: Path, text: str, *overrides: str) -> list[Event]:
    return list(part_events(spec, folder, text, *overrides))


def build_at_once(spec: Path, folder: Path, count: int, *overrides: str) -> list[Path]:
    """Parts in one folder, each a step further in turn."""
    parts = [folder / str(number) for number in range(1, count + 1)]
    list(zip_longest(*(part_events(spec, part, f"{part.name}/{count}", *overrides) for part in parts)))
    return parts


def merge_all(spec: Path, parts: Sequence[Path], folder: Path, *overrides: str) -> list[Event]:
    return list(merge(load_dataset(spec, overrides), parts, folder))


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, list[Path]]:
    """Spec, the folder of one build, and its three parts."""
    folder = tmp_path_factory.mktemp("three")
    spec = write_spec(folder / "spec")
    run_build(spec, folder / "one", *QUICK)
    return spec, folder / "one", build_at_once(spec, folder / "parts", 3, *QUICK)


def test_parts_in_any_order_are_one_build(three: tuple[Path, Path, list[Path]], tmp_path: Path,
                                          monkeypatch: pytest.MonkeyPatch) -> None:
    spec, one, parts = three
    monkeypatch.setattr(Planner, "view", lambda *_: pytest.fail("planned again"))
    events = merge_all(spec, [parts[2], parts[0], parts[1], parts[0]], tmp_path / "out", *QUICK)
    assert contents(tmp_path / "out") == contents(one) and not verify(tmp_path / "out")
    assert sum(event.shard is not None for event in events) == len(list((one / "shards").iterdir()))

    def steps(folder: Path) -> list[list[str]]:
        return [line.split(",")[:2] for line in (folder / "seconds.csv").read_text().splitlines()]

    assert steps(tmp_path / "out") == steps(one)
    assert tree(tmp_path / "out" / WORK / "rejected") == tree(one / WORK / "rejected") != {}
    # Again, with parts that are there, and with the dataset alone that a build finds
    noted = tree(tmp_path / "out" / WORK, "*.jsonl")
    events = merge_all(spec, parts, tmp_path / "out", *QUICK)
    assert not any(event.shard for event in events) and contents(tmp_path / "out") == contents(one)
    assert tree(tmp_path / "out" / WORK, "*.jsonl") == noted != {}
    monkeypatch.undo()
    assert all(outcome.kept for outcome in outcomes_of(run_build(spec, tmp_path / "out", *QUICK)).values())


def tree(folder: Path, pattern: str = "*") -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.glob(pattern))}


@needs_oidn
def test_parts_measure_the_denoiser_and_make_fields_each(tmp_path: Path) -> None:
    """Denoisers are measured on examples of the whole dataset, so that every part needs the field."""
    spec = write_spec(tmp_path / "spec")
    run_build(spec, tmp_path / "one", *SEEN)
    parts = build_at_once(spec, tmp_path / "parts", 3, *SEEN)
    assert sum(len(list((part / WORK / "fields").glob("*.npz"))) for part in parts) == 3
    merge_all(spec, parts, tmp_path / "out", *SEEN)
    assert contents(tmp_path / "out") == contents(tmp_path / "one")
    manifest = load_manifest(tmp_path / "out")
    assert manifest.fields and manifest.denoised


def test_a_part_that_is_whole_is_not_planned_again(three: tuple[Path, Path, list[Path]], tmp_path: Path,
                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    spec, _, parts = three
    shutil.copytree(parts[1], tmp_path / "2")
    monkeypatch.setattr("dataset_builder.builder.run_unit", lambda *_: pytest.fail("made again"))
    events = build_part(spec, tmp_path / "2", "2/3", *QUICK)
    assert all(outcome.kept for outcome in outcomes_of(events).values()) and len(outcomes_of(events)) == 3
    assert events[-1].part == read_record(parts[1])


def changed(folder: Path, **update: object) -> None:
    """Change what the record of a part says, sealed anew."""
    path = folder / ".build" / "part.json"
    content = unsealed(path.read_bytes())
    assert content is not None
    path.write_bytes(sealed(content | update))


def cut(folder: Path) -> None:
    path = next((folder / ".build" / "staging").glob("*.segment"))
    path.write_bytes(path.read_bytes()[:-1] + b"\1")


def swapped(folder: Path) -> None:
    """Another whole example in the place of one: its own seal fits."""
    first, second = sorted((folder / ".build" / "staging").glob("*.segment"))[:2]
    for suffix in (".segment", ".json"):
        shutil.copy(second.with_suffix(suffix), first.with_suffix(suffix))


def version(name: str, value: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        changed(folder, made_by=json.loads((folder / ".build/part.json").read_bytes())["made_by"] | {name: value})
    return change


@pytest.mark.parametrize(("change", "said"), [
    (shutil.rmtree, [r"2: expected a finished part, found none \(dataset-builder build \S+small.yaml --set .* --part "
                     "k/n --out"]),
    (lambda folder: (folder / ".build/part.json").unlink(), ["2: expected a finished part"]),
    (version("variant", "cuda_ad_rgb"), [r"2: expected part 2/3 to be like part 1/3 in .*1, got variant cuda_ad_rgb "
                                         "in place of llvm", "one --backend"]),
    (version("llvm", "99.0"), ["got llvm 99.0 in place of"]),
    (lambda folder: changed(folder, spec_digest="0" * 64), ["got part 2/3 of another spec, or of other values of"]),
    (lambda folder: changed(folder, of=4), ["got one of 4 parts in place of 3"]),
    (lambda folder: changed(folder, number=3), ["expected the examples of part 3/3, got others", "expected part 2/3, "
                                                "found none", "--part 2/3 --out DIR"]),
    (lambda folder: changed(folder, examples={}), ["expected the examples of part 2/3, got others"]),
    (cut, [r"2: example 0000000\d of part 2/3 is missing or damaged \(dataset-builder build .* --part 2/3 --out "]),
    (swapped, ["of part 2/3 is missing or damaged"]),
    (lambda folder: [path.unlink() for path in (folder / ".build/staging").glob("*.segment")],
     ["of part 2/3 is missing or damaged"])])
def test_what_does_not_belong_is_named(three: tuple[Path, Path, list[Path]], tmp_path: Path,
                                       change: Callable[[Path], object], said: list[str]) -> None:
    spec, one, parts = three
    mine = [Path(shutil.copytree(part, tmp_path / part.name)) for part in parts]
    change(mine[1])
    with pytest.raises(OutputError) as caught:
        merge_all(spec, mine, tmp_path / "out", *QUICK)
    for pattern in said:
        assert re.search(pattern, str(caught.value)), str(caught.value)
    assert not (tmp_path / "out" / "dataset.json").exists()
    # The command that was named mends it, and a second merge goes on
    build_part(spec, mine[1], "2/3", *QUICK)
    merge_all(spec, mine, tmp_path / "out", *QUICK)
    assert contents(tmp_path / "out") == contents(one)


def test_parts_of_other_code_are_refused(three: tuple[Path, Path, list[Path]], tmp_path: Path) -> None:
    spec, _, parts = three
    mine = [Path(shutil.copytree(part, tmp_path / part.name)) for part in parts]
    for part in mine:
        version("source", "0" * 64)(part)
    with pytest.raises(OutputError, match="expected part 1/3 to be made by the code that merges it, got source 0000"):
        merge_all(spec, mine, tmp_path / "out", *QUICK)


def test_a_part_is_missing(three: tuple[Path, Path, list[Path]], tmp_path: Path) -> None:
    spec, _, parts = three
    with pytest.raises(OutputError, match=r"^expected part 3/3, found none \(make it: dataset-builder build") as caught:
        merge_all(spec, parts[:2], tmp_path / "out", *QUICK)
    assert len(caught.value.problems) == 1
    with pytest.raises(OutputError, match="expected another folder than those of the parts"):
        merge_all(spec, parts, parts[0], *QUICK)


def test_a_part_beside_a_dataset_leaves_it_and_takes_over_what_it_has(three: tuple[Path, Path, list[Path]],
                                                                      tmp_path: Path,
                                                                      monkeypatch: pytest.MonkeyPatch) -> None:
    spec, one, parts = three
    shutil.copytree(one, tmp_path / "set")
    monkeypatch.setattr("dataset_builder.rendering.examples.render_view", lambda *_: pytest.fail("rendered again"))
    build_part(spec, tmp_path / "set", "1/3", *QUICK)
    assert contents(tmp_path / "set") == contents(one)
    assert read_record(tmp_path / "set") == read_record(parts[0])
    merge_all(spec, [tmp_path / "set", *parts[1:]], tmp_path / "out", *QUICK)
    assert contents(tmp_path / "out") == contents(one)


def test_more_parts_than_views(three: tuple[Path, Path, list[Path]], tmp_path: Path) -> None:
    spec, one, parts = three
    mine = [tmp_path / str(number) for number in range(1, 6)]
    for number, part in enumerate(mine, 1):
        # What is staged already is found again, so that nothing is rendered
        shutil.copytree(parts[0] / ".build", part / ".build")
        for other in parts[1:]:
            shutil.copytree(other / ".build", part / ".build", dirs_exist_ok=True)
        build_part(spec, part, f"{number}/5", *QUICK)
    assert sorted(len(record.examples) for part in mine if (record := read_record(part))) == [0, 0, 2, 2, 2]
    merge_all(spec, mine, tmp_path / "out", *QUICK)
    assert contents(tmp_path / "out") == contents(one)


def test_the_command_line(three: tuple[Path, Path, list[Path]], tmp_path: Path,
                          capsys: pytest.CaptureFixture[str]) -> None:
    spec, one, parts = three
    sets = [text for override in QUICK for text in ("--set", override)]
    for wrong in (["--part", "4/3"], ["--part", "1/3", "--example", "0"], ["--part", ""]):
        assert main(["build", str(spec), *sets, "--out", str(tmp_path / "1"), *wrong]) == 2
        assert "--part: expected" in capsys.readouterr().err and not (tmp_path / "1").exists()
    assert main(["merge", str(spec), *sets, *map(str, parts), "--out", str(tmp_path / "out")]) == 0
    assert contents(tmp_path / "out") == contents(one)
    assert main(["merge", str(spec), *map(str, parts), "--out", str(tmp_path / "other")]) == 2
    assert "other values of --set" in capsys.readouterr().err
