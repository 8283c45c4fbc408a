"""What is too much, or no file at all: one clear problem, soon, whatever it would unfold to."""

import os
from itertools import pairwise
from pathlib import Path
from time import perf_counter

import pytest

from dataset_builder.errors import SpecError
from dataset_builder.rendering.field import field_figures, field_pixels
from dataset_builder.spec import field
from dataset_builder.spec.load import MOST_BYTES, MOST_NODES, load_dataset, read_document, read_text

SECONDS = 15.0
TOO_MUCH = "expected valid YAML of at most 20000 keys and values, aliases repeated, nested at most 40 deep"
LETTERS = [chr(97 + number) for number in range(12)]


def bomb(first: str, again: str) -> str:
    """Twelve keys of which each holds the one before nine times."""
    lines = [f"{key}: &{key} {again.format(','.join([f'*{last}'] * 9))}" for last, key in pairwise(LETTERS)]
    return "\n".join([f"a: &a {first}", *lines])


def problem(text: str) -> str:
    begin = perf_counter()
    with pytest.raises(SpecError) as caught:
        read_text(text, "x.yaml")
    assert perf_counter() - begin < SECONDS
    found, = map(str, caught.value.problems)
    assert len(found) < 300
    return found


@pytest.mark.parametrize("text", [
    bomb("[x]", "[{}]"), bomb("{x: 1}", "{{<<: [{}]}}"), "a: [" + "1," * 200_000 + "1]", "a: " + "[" * 41 + "]" * 41,
    "[" * 100_000, "\n".join(f"k{number}: 1" for number in range(MOST_NODES)),
    "".join(" " * depth + "a:\n" for depth in range(1000))])
def test_bombs_are_defused(text: str) -> None:
    assert TOO_MUCH in problem(text)


@pytest.mark.parametrize(("text", "message"), [
    ("a: 0x" + "f" * 100_000, "expected a number that can be read"),
    ("a: " + "9" * 4000, "expected a number that can be read"), ("a: " + "9" * 5000, "a number that can be read"),
    ('title: "\\e[31m"', r"expected text without control characters, got '\x1b' in '\x1b[31m'"),
    ('title: "\\ud800"', r"expected text without control characters, got '\ud800'"),
])
def test_values_that_nothing_holds(text: str, message: str) -> None:
    assert message in problem(text)


@pytest.mark.parametrize("kind", ["device", "FIFO", "folder", "100 MB"])
def test_a_spec_is_a_small_file(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "x.yaml"
    if kind == "FIFO":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "device":
        path.symlink_to("/dev/zero")
    else:
        path.write_text("a: " + "x" * 10**8)
    rule = {"100 MB": f"larger than {MOST_BYTES:,} bytes", "folder": "Is a directory"}.get(kind, "not a regular file")
    with pytest.raises(SpecError, match=rf"x\.yaml: expected a readable file, got: {rule}"):
        read_document(path, "x.yaml")


@pytest.mark.parametrize(("extra", "message"), [
    ("seed: 3\nsource: {environment: sky.exr}", "source.environment: expected an image, found none at 'sky.exr'"),
    ("title: \"one\\ntwo\"", "title: expected text that matches"),
    ("title: " + "x" * 201, "title: expected 200 or fewer characters"),
    ("version: 1.0." + "0" * 40, "version: expected 30 or fewer characters"),
    ("source: {environment: " + "x" * 300 + ".exr}", "source.environment: expected an image, found none"),
    ("storage: {examples_per_shard: 18446744073709551615}", "storage.examples_per_shard: expected <= 5000"),
])
def test_limits_of_keys(tiny, extra: str, message: str) -> None:
    text = tiny().read_text().replace("seed: 3\n", "") + extra + "\n"
    path = tiny(**{"tiny.yaml": text})
    if "sky" in extra:
        os.mkfifo(path.parent / "sky.exr")
    with pytest.raises(SpecError, match=message):
        load_dataset(path)


@pytest.mark.parametrize(("override", "message"), [
    ("name=" + "x" * 245, "name: expected 100 or fewer characters"),
    ("splits.train.name=" + "x" * 245, r"splits\[0\].name: expected 50 or fewer characters"),
    ("splits.train.objects.count=18446744073709551615", "objects.count: expected <= 1000000"),
    ("splits.train.views=18446744073709551615", "views: expected <= 1000000"),
    ("splits.train.views=1000000", "splits: expected at most 1000000 examples of all splits together, got "),
    ("splits.train.source={kind: field, views: 301}", "source.views: expected <= 300, got 301"),
    ("splits.train.source={kind: field, held_out: 65}", "source.held_out: expected <= 64, got 65"),
    ("splits.train.source={field: density}", "source.kind: expected `kind: field` beside field, got kind mesh"),
    ("splits.train.source={kind: mesh, views: 100}", "source.kind: expected `kind: field` beside views, got kind mesh"),
    ("rough.fields=[{}, {field: sdf}, {gates: {psnr: 1}}]",
     r"rough.fields\[2\]: expected fields that differ .* got the field of fields\[0\]"),
    ("render.spp={first_hit: 1, source: 4, target: 4, rough: 4}",
     r"render.spp.first_hit: expected at least 2, since the gate radiance_split .* got 1 \(take 16 or more"),
    ("source={sun: {through: window_1}}", r"source.sun.through: expected no `through` where the walls are removed"),
    ("source={sun: {through: door}, open: []}", "source.sun.through: expected"),
    ("splits.train.oddly=1", r"expected no such key, got 1 \(known keys: "),
    (".".join("a" * 3000) + "=1", "expected a path of at most 40 keys, got 3000"),
    ("splits.train.objects.from=[" + "x" * 300 + ".yaml]", "expected a spec file, found none"),
])
def test_limits_of_overrides(tiny, override: str, message: str) -> None:
    begin = perf_counter()
    with pytest.raises(SpecError, match=message) as caught:
        load_dataset(tiny(), [override])
    assert perf_counter() - begin < SECONDS and "Traceback" not in str(caught.value)


GLTF = '{"asset": {"version": "2.0"}, '


@pytest.mark.parametrize(("name", "content", "message"), [
    ("a.gltf", GLTF + '"buffers": [{"uri": "/dev/zero"}]}', "expected a name relative to the file, got '/dev/zero'"),
    ("a.gltf", "[" * 100_000, "nested without end"),
    ("a.gltf", GLTF + '"images": [null]}', "expected images to be a list of objects"),
    ("a.gltf", GLTF + '"buffers": 7}', "expected buffers to be a list of objects, got 7"),
    ("a.gltf", GLTF + '"images": [{"uri": "x\\u0000"}]}', "cannot be read"),
])
def test_meshes_are_files(tiny, name: str, content: str, message: str) -> None:
    with pytest.raises(SpecError, match=message):
        load_dataset(tiny(**{"objects/chair.yaml": f"file: {name}\n", f"objects/{name}": content}))


def test_fields_use_all_images_that_a_spec_may_ask_for() -> None:
    assert (field.MOST_VIEWS, field.MOST_HELD_OUT) == (field_pixels.MOST_IMAGES, field_figures.MOST_HELD_OUT)
