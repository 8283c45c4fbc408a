"""YAML 1.2 as plain data with lines."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dataset_builder.errors import SpecError
from dataset_builder.spec.load import read_document, read_text


@pytest.mark.parametrize(("text", "value"), [
    ("1e-3", 0.001), ("1E5", 1e5), ("-2.5", -2.5), ("7", 7), ("0o17", 15), (".5", 0.5), ("true", True), ("~", None),
    ("no", "no"), ("on", "on"), ("yes", "yes"), ("'5'", "5"), ("2024-01-01", "2024-01-01"), ("1.2.3", "1.2.3"),
    ("[1, [a]]", (1, ("a",))), ("{a: {b: 1}}", {"a": {"b": 1}}), ("", None), ("# only a comment", None),
])
def test_values(text: str, value: object) -> None:
    data = read_text(text, "x.yaml").data
    assert data == value
    assert type(data) is type(value)


@given(st.one_of(st.floats(allow_nan=False, allow_infinity=False), st.integers(-10**30, 10**30)))
def test_numbers_round_trip(number: float) -> None:
    assert read_text(f"a: {number!r}", "x.yaml").data == {"a": number}


def test_every_path_has_its_line() -> None:
    document = read_text("a: 1\nb:\n  - x\n  - c:\n      d: 2\n", "x.yaml")
    assert {path: place.split(":")[1] for path, place in document.places.items()} == {
        (): "1", ("a",): "1", ("b",): "2", ("b", 0): "3", ("b", 1): "4", ("b", 1, "c"): "4", ("b", 1, "c", "d"): "5"}
    assert document.place(("b", 1, "missing")) == "x.yaml:4"


def test_anchors_and_merge_keys() -> None:
    text = "base: &base {a: 1, b: 2}\nsame: *base\nmore:\n  <<: *base\n  b: 3\n"
    data = read_text(text, "x.yaml").data
    assert data["same"] == {"a": 1, "b": 2}
    assert data["more"] == {"a": 1, "b": 3}


@pytest.mark.parametrize(("text", "message"), [
    ("a: 1\nb: 2\na: 3\n", "x.yaml:3: a: expected each key once, got it again (first at line 1)"),
    ("a: 1\n\tb: 2\n", "x.yaml:2: expected valid YAML, got: found character '\\t'"),
    ("a: [1, 2\n", "x.yaml:2: expected valid YAML, got: expected ',' or ']'"),
    ("a: b: c\n", "x.yaml:1: expected valid YAML"),
    ("a: 1\n---\nb: 2\n", "x.yaml:2: expected valid YAML, got: but found another document"),
    ("a: *nowhere\n", "x.yaml:1: expected valid YAML, got: found undefined alias"),
    ("a: 1\nb: \x07\n", "x.yaml:2: expected valid YAML, got: a character that YAML forbids"),
    ("a: !!python/name:os.system\n", "x.yaml:1: a: expected plain YAML without tags, got python/name:os.system"),
    ("1: a\n", "x.yaml:1: expected text as a key, got '1'; put it in quotes"),
    ("? [a, b]\n: 1\n", "x.yaml:1: expected text as a key"),
    ("a: &a\n  - *a\n", "expected data without cycles"),
    ("a: " + "9" * 5000, "x.yaml:1: a: expected a number that can be read"),
    ("<<: 3\na: 1\n", "x.yaml:1: expected a mapping to merge"),
    ("[" * 3000, "expected valid YAML"),
])
def test_broken_text(text: str, message: str) -> None:
    with pytest.raises(SpecError) as caught:
        read_text(text, "x.yaml")
    assert message in str(caught.value)


@pytest.mark.parametrize(("content", "message"), [
    (b"", "x.yaml:1: expected a mapping of keys, got an empty file"),
    (b"- a\n- b\n", "x.yaml:1: expected a mapping of keys, got a list"),
    (b"word", "x.yaml:1: expected a mapping of keys, got a single value"),
    (b"name: caf\xe9\n", "x.yaml: expected UTF-8 text, got byte 0xe9 at offset 9"),
])
def test_broken_files(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "x.yaml").write_bytes(content)
    with pytest.raises(SpecError) as caught:
        read_document(tmp_path / "x.yaml", "x.yaml")
    assert str(caught.value) == message


def test_unreadable_files(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"nope\.yaml: expected a file, found none"):
        read_document(tmp_path / "nope.yaml", "nope.yaml")
    with pytest.raises(SpecError, match="expected a readable file"):
        read_document(tmp_path, "folder")


def test_byte_order_mark_is_no_key(tmp_path: Path) -> None:
    (tmp_path / "x.yaml").write_bytes("\ufeffa: 1\n".encode())
    assert read_document(tmp_path / "x.yaml", "x.yaml").data == {"a": 1}
