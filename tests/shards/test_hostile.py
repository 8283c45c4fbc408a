"""Manifests, indexes and files made to mislead: problems in words, soon, and nothing outside the dataset is read."""

import json
import os
import resource
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

import pytest

from dataset_builder.errors import ShardError
from dataset_builder.shards.folder import CARD, CROISSANT, MANIFEST, SUMS
from dataset_builder.shards.reader import open_dataset
from dataset_builder.shards.verify import verify
from tests.shards.test_verify import STEM, edit, found
from tests.shards.tiny_dataset import index_path, shard_path

SECONDS, GROWTH = 10.0, 2**30
"""What one hostile file may take; bytes that the largest may add to this process's memory."""
DEEP = 100_000
Change = Callable[[Any], None]


def put(*path: str | int, value: Any) -> Change:
    """Sets the value at a path of keys and indices."""
    def change(content: Any) -> None:
        for part in path[:-1]:
            content = content[part]
        content[path[-1]] = value
    return change


MANIFESTS: dict[str, Change] = {
    "identity of another name": put("identities", 0, "name", value="rnage"),
    "no identities": put("identities", value=[]),
    "identity twice": lambda content: content["identities"].append(content["identities"][0]),
    "tolerance beyond all": put("identities", 0, "tolerance", value=1e308),
    "tolerance below 0": put("identities", 1, "tolerance", value=-1),
    "tolerance of text": put("identities", 0, "tolerance", value="wide"),
    "absolute name": put("shards", 0, "name", value="/etc/passwd.tar"),
    "name that leads up": put("shards", 0, "name", value="../../secret.tar"),
    "name with a folder": put("shards", 0, "name", value="x/y.tar"),
    "name too long": put("shards", 0, "name", value="x" * 300 + ".tar"),
    "name of a megabyte": put("shards", 0, "name", value="x" * 2**20 + ".tar"),
    "name with NUL": put("shards", 0, "name", value="x\0.tar"),
    "name with a line end": put("shards", 0, "name", value="x\n.tar"),
    "name that is empty": put("shards", 0, "name", value=""),
    "name without suffix": put("shards", 0, "name", value=STEM),
    "name that is a number": put("shards", 0, "name", value=7),
    "name in other letters": put("shards", 0, "name", value="ｔｉｎｙ.tar"),
    "name with half a letter": put("shards", 0, "name", value="\ud800.tar"),
    "shard of 2^70 bytes": put("shards", 0, "bytes", value=2**70),
    "shard of negative bytes": put("shards", 0, "bytes", value=-1),
    "shard of half a byte": put("shards", 0, "bytes", value=0.5),
    "shard of 2^70 examples": put("shards", 0, "examples", value=2**70),
    "shard of no hash": put("shards", 0, "sha256", value=""),
    "shard that is null": put("shards", 0, value=None),
    "shard of no split": put("shards", 0, "split", value="none"),
    "shards that are text": put("shards", value="all"),
    "shards ten thousand times": lambda content: content["shards"].extend(content["shards"][:1] * 10_000),
    "huge totals": put("totals", value={"examples": 2**80, "shards": 2**80, "bytes": 2**80, "rejected": 2**80}),
    "wrong totals": put("totals", "examples", value=2**52),
    "totals that are a list": put("totals", value=[1, 2, 3]),
    "width 0": put("width", value=0),
    "width beyond all": put("width", value=2**40),
    "height below 0": put("height", value=-6),
    "layer nobody knows": put("layers", 0, "name", value="albedo"),
    "layer twice": lambda content: content["layers"].append(content["layers"][0]),
    "no layers": put("layers", value=[]),
    "layer of 2^40 channels": put("layers", 0, "channels", value=2**40),
    "layer of another type": put("layers", 0, "dtype", value="float64"),
    "layer that leads up": put("layers", 0, "name", value="../d"),
    "no splits": put("splits", value=[]),
    "split twice": lambda content: content["splits"].append(content["splits"][0]),
    "split of all shards": put("splits", 0, "shards", value=["x.tar"] * 10_000),
    "unknown keys by the thousand": lambda content: content.update({f"k{number}": 0 for number in range(50_000)}),
    "format of others": put("format", value="4df-lighting"),
    "rejected that is shipped": put("rejected", value=[{"key": "00000000", "view": "x", "gate": "g", "reason": "r"}]),
}

TEXTS: dict[str, bytes] = {
    "nested without end": b'{"name":' * DEEP, "lists without end": b"[" * DEEP, "NaN": b'{"width": NaN}',
    "number of a million digits": b'{"width": ' + b"9" * 10**6 + b"}", "no UTF-8": b'{"title": "\xff\xfe"}',
    "nothing": b"", "null": b"null", "a list": b"[]", "text of 80 MB": b'"' + b"x" * 80_000_000 + b'"',
}

INDEXES: dict[str, Change] = {
    "offset of 2^70": put("examples", 0, "members", 0, "offset", value=2**70),
    "offset of 2^52": put("examples", 0, "members", 0, "offset", value=2**52),
    "offset below 0": put("examples", 0, "members", 0, "offset", value=-512),
    "size of 2^70": put("examples", 0, "members", 0, "size", value=2**70),
    "size of 2 GB": put("examples", 0, "members", 0, "size", value=2**31 - 1),
    "size below 0": put("examples", 0, "members", 0, "size", value=-1),
    "member that leads up": put("examples", 0, "members", 0, "name", value="../../etc/passwd"),
    "member too long": put("examples", 0, "members", 0, "name", value="0" * 10**6),
    "member of no name": put("examples", 0, "members", 0, "name", value=""),
    "member that is null": put("examples", 0, "members", 0, value=None),
    "no members": put("examples", 0, "members", value=[]),
    "no examples": put("examples", value=[]),
    "key of letters": put("examples", 0, "key", value="../../x"),
    "key of others": put("examples", 0, "key", value="99999999"),
    "one member ten thousand times":
        lambda content: content["examples"][0]["members"].extend(content["examples"][0]["members"][:1] * 10_000),
    "shard of another name": put("shard", "name", value="/etc/passwd"),
}


@pytest.fixture(autouse=True)
def nothing_outside(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Opening a file beside the dataset is a failure."""
    opened = os.open

    def inside(path: Any, *arguments: Any, **options: Any) -> int:
        text = os.fspath(path)
        assert not isinstance(text, str) or dataset in (place := Path(os.path.abspath(text))).parents or (
            place in dataset.parents or place == dataset), text
        return opened(path, *arguments, **options)

    monkeypatch.setattr(os, "open", inside)


def problems_of_all(folder: Path) -> list[str]:
    """What `verify` says; the reader says so too or reads everything. Both soon, and in little memory."""
    before, begin = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, perf_counter()
    problems = list(map(str, verify(folder)))
    try:
        list(open_dataset(folder))
    except ShardError as error:
        assert str(error)
    assert perf_counter() - begin < SECONDS
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < GROWTH
    assert sum(map(len, problems)) < 10**7
    return problems


@pytest.mark.parametrize("name", MANIFESTS)
def test_a_hostile_manifest_is_a_list_of_problems(dataset: Path, name: str) -> None:
    rewrite(dataset / "dataset.json", MANIFESTS[name])
    assert problems_of_all(dataset)


@pytest.mark.parametrize("name", INDEXES)
def test_a_hostile_index_is_a_list_of_problems(dataset: Path, name: str) -> None:
    rewrite(index_path(dataset, STEM), INDEXES[name])
    assert problems_of_all(dataset)


@pytest.mark.parametrize("file", ["dataset.json", f"index/{STEM}-*.manifest", CROISSANT])
@pytest.mark.parametrize("name", TEXTS)
def test_text_that_is_no_json_of_ours_is_a_problem(dataset: Path, name: str, file: str) -> None:
    path, = dataset.glob(file)
    path.write_bytes(TEXTS[name])
    assert problems_of_all(dataset)


def rewrite(path: Path, change: Change) -> None:
    """As `edit`, for texts that no encoder of ours would write."""
    content = json.loads(path.read_bytes())
    change(content)
    path.write_text(json.dumps(content))
    edit(path, lambda content: None) if "\\ud800" not in path.read_text() else None


@pytest.mark.parametrize("file", [f"shards/{STEM}-*.tar", f"index/{STEM}-*.manifest", MANIFEST, CARD, CROISSANT, SUMS])
@pytest.mark.parametrize("kind", ["link to nothing", "link to itself", "FIFO", "folder", "device"])
def test_what_is_no_file_is_a_problem(dataset: Path, file: str, kind: str) -> None:
    path, = dataset.glob(file)
    path.unlink()
    if kind == "FIFO":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to({"link to nothing": "nowhere", "link to itself": path.name, "device": "/dev/zero"}[kind])
    assert any(path.name in problem for problem in problems_of_all(dataset))


def test_sums_are_looked_into_line_by_line(dataset: Path) -> None:
    sums, card = (dataset / SUMS).read_text(), (dataset / CARD).read_text()
    (dataset / CARD).write_text("changed")
    (dataset / SUMS).write_text("")
    assert f"{SUMS}: expected every file of the dataset once" in found(dataset)
    (dataset / CARD).write_text(card)
    for line in ("0" * 64 + "  /etc/passwd", "0" * 64 + "  ../tiny/README.md", sums.splitlines()[0],
                 "0" * 64 + "  " + "x" * 5000):
        (dataset / SUMS).write_text(f"{sums}{line}\n")
        assert f"{SUMS}: expected every file of the dataset once" in found(dataset)
    (dataset / SUMS).write_text(sums)
    assert verify(dataset) == []


def test_a_shard_with_a_hole_of_a_terabyte_is_not_read_to_its_end(dataset: Path) -> None:
    size = shard_path(dataset, STEM).stat().st_size
    os.truncate(shard_path(dataset, STEM), 2**40)
    name = shard_path(dataset, STEM).name
    assert f"{name}: expected {size} bytes, got {2**40}" in "\n".join(problems_of_all(dataset))
