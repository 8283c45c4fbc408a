"""What splits share without a word is refused; the split that says so may take what others have."""

import json
from pathlib import Path

import pytest

from dataset_builder.errors import SpecError
from dataset_builder.report.spec_help import export_schema
from dataset_builder.spec.load import load_dataset

SPLIT = ("  - {{name: {name}, objects: {{count: 1, from: [stool.yaml]}}, "
         "scenes: {{count: 1, from: [den.yaml]}}{more}}}\n")
FILES = {"stool.yaml": "file: a.obj\nlicence: CC0-1.0\n", "a.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
         "den.yaml": "room: room.yaml\n", "room.yaml": "width: 4\n"}


def problems(path: Path) -> list[str]:
    with pytest.raises(SpecError) as caught:
        load_dataset(path)
    return [problem.path for problem in caught.value.problems]


def write(folder: Path, **splits: str) -> Path:
    """A dataset whose splits all have one mesh file; values: what else each says."""
    text = "name: one\nsplits:\n" + "".join(SPLIT.format(name=name, more=f", {more}" if more else "")
                                           for name, more in splits.items())
    for name, content in {**FILES, "one.yaml": text}.items():
        (folder / name).write_text(content)
    return folder / "one.yaml"


def test_either_of_two_splits_may_allow_it(tmp_path: Path) -> None:
    assert problems(write(tmp_path, a="", b="")) == ["splits[1].objects.from[0]"]
    for said in ({"a": "", "b": "allow_shared: [objects]"}, {"a": "allow_shared: [objects]", "b": ""}):
        assert load_dataset(write(tmp_path, **said)).dataset.splits[0].objects.count == 1


def test_the_word_of_one_split_is_not_that_of_two_others(tmp_path: Path) -> None:
    """Whichever of them comes first."""
    assert problems(write(tmp_path, b="allow_shared: [objects]", a="", c="")) == ["splits[2].objects.from[0]"]
    assert problems(write(tmp_path, a="", b="allow_shared: [objects]", c="")) == ["splits[2].objects.from[0]"]
    assert problems(write(tmp_path, a="", b="allow_shared: [scenes]")) == ["splits[1].objects.from[0]"]
    assert problems(write(tmp_path, a="", b="allow_shared: [object]")) == ["splits[1].allow_shared[0]"]


def test_what_is_allowed_makes_no_other_examples(tmp_path: Path) -> None:
    """Digests of a split's examples do not see it, and a spec without it has the digest that it had before."""
    plain = load_dataset(write(tmp_path, a=""))
    said = load_dataset(write(tmp_path, a="allow_shared: [objects]"))
    assert plain.split_digest(plain.dataset.splits[0], 0) == said.split_digest(said.dataset.splits[0], 0)
    assert "allow_shared" not in json.dumps(plain.content()) and plain.spec_digest != said.spec_digest


def test_a_file_is_still_one_object_within_a_split(tmp_path: Path) -> None:
    write(tmp_path, a="", b="allow_shared: [objects]")
    with pytest.raises(SpecError, match=r"objects\.count: expected <= 1, since each mesh file is one object"):
        load_dataset(tmp_path / "one.yaml", ["splits.b.objects.count=2"])


def test_layers_may_be_a_list(tmp_path: Path) -> None:
    path = write(tmp_path, a="")
    asked = load_dataset(path, ["layers=[i_s,i_t,{s_prime: frame, d: object}]"]).dataset.layers
    assert asked == {"i_s": "object", "i_t": "object", "s_prime": "frame", "d": "object"}
    mapped = load_dataset(path, ["layers={i_s: object, i_t: object, s_prime: frame, d: object}"])
    assert mapped.dataset.layers == asked
    assert mapped.spec_digest == load_dataset(path, ["layers=[i_s,i_t,{s_prime: frame, d: object}]"]).spec_digest


@pytest.mark.parametrize(("text", "message"), [
    ("[i_s,i_q]", "layers.i_q: expected a layer, got 'i_q'"), ("[i_s,3]", r"layers[1]: expected a layer, or one with"),
    ("[i_s,{i_s: frame}]", "layers[1]: expected each layer once, got i_s again"),
    ("[]", "layers: expected 1 or more entries"), ("[{i_s: half}]", "layers.i_s: expected 'object' or 'frame'"),
    ("i_s", "layers: expected a mapping, got 'i_s'"), ("[[i_s]]", "layers[0]: expected a layer, or one with"),
])
def test_wrong_lists_of_layers(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(SpecError) as caught:
        load_dataset(write(tmp_path, a=""), [f"layers={text}"])
    assert message in str(caught.value) and len(caught.value.problems) == 1


@pytest.mark.parametrize(("layers", "valid"), [
    (["i_s", {"i_t": "frame"}], True), ({"i_s": "frame"}, True), (["q"], False), ([], False), ({"i_s": "q"}, False)])
def test_the_schema_knows_lists(layers: object, valid: bool) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    schema = export_schema()["dataset"]
    only = {**schema["properties"]["layers"], "$defs": schema["$defs"]}
    assert jsonschema.Draft202012Validator(only).is_valid(layers) is valid
