"""Datasets at an address: the same examples as in a folder under every fault, or a reason; and a shared cache."""

import json
import multiprocessing
import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.digest import sha256_file
from dataset_builder.errors import OutputError, ShardError
from dataset_builder.remote.patience import Patience
from dataset_builder.shards.folder import SUMS
from dataset_builder.shards.reader import Dataset, load_manifest, open_dataset
from tests.fault_proxy import Fault, Plan, fault_proxy
from tests.file_servers import KEYS, needs_nginx, nginx_server, range_server, s3_server
from tests.shards.tiny_dataset import build, index_path, shard_path

MENDED: tuple[Fault, ...] = ("truncated", "shifted", "error", "busy", "stall", "reset", "whole")
"""Faults that cost time, whatever is asked for; the last one where the server has sent a piece before."""
HASHED: tuple[Fault, ...] = ("flipped", "changed")
"""Faults that digests find: in `dataset.json` and SHA256SUMS they are errors."""
STEM = "tiny-v1-train-000000"


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished dataset of four examples in three shards; not to be changed."""
    folder = tmp_path_factory.mktemp("remote") / "tiny"
    build(folder)
    return folder


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("dataset_builder.remote.open_place.PATIENCE",
                        Patience(attempts=4, stall=0.3, first=0.001, longest=0.01))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def assert_equal(found: Dataset, folder: Path) -> None:
    """Every example, label and split as they are in a folder."""
    expected = open_dataset(folder)
    assert found.splits == expected.splits and len(found) == len(expected)
    for one, other in zip(found, expected, strict=True):
        assert one.keys() == other.keys() and one["meta"] == other["meta"]
        assert all(np.array_equal(one[name], other[name]) for name in found.layers)
    assert list(found.labels(found.splits["train"])) == [expected.label(key) for key in expected.splits["train"]]


@pytest.mark.parametrize("kind", ["python", pytest.param("nginx", marks=needs_nginx)])
def test_a_dataset_at_an_address_is_the_one_in_its_folder(tiny: Path, kind: str, tmp_path: Path) -> None:
    with range_server(tiny) if kind == "python" else nginx_server(tiny, tmp_path) as address:
        assert_equal(open_dataset(address), tiny)
        assert load_manifest(address) == load_manifest(tiny)


def test_a_dataset_in_s3(tiny: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in KEYS.items():
        monkeypatch.setenv(name, value)
    with s3_server(tiny, "bucket") as address:
        monkeypatch.setenv("AWS_ENDPOINT_URL", address)
        assert_equal(open_dataset("s3://bucket/"), tiny)
        with pytest.raises(ShardError, match=r"s3://bucket/none: .*expected a finished dataset"):
            open_dataset("s3://bucket/none")


@pytest.mark.parametrize("fault", [*MENDED, *HASHED])
def test_an_epoch_is_exact_under_faults(tiny: Path, fault: Fault) -> None:
    plan = Plan(faults=[fault], only=r"tar|manifest" if fault in MENDED else "tar", rate=float(fault != "whole"))
    with range_server(tiny) as upstream, fault_proxy(upstream, plan) as address:
        data = open_dataset(address)
        plan.rate = 1.0
        assert_equal(data, tiny)
    assert fault in {one.fault for one in plan.served}


@pytest.mark.parametrize("seed", range(3))
def test_an_epoch_is_exact_under_faults_of_all_kinds(tiny: Path, seed: int) -> None:
    plan = Plan(faults=MENDED[:-1], rate=0.5, only=r"\.tar", seed=seed)
    with range_server(tiny) as upstream, fault_proxy(upstream, plan) as address:
        data = open_dataset(address)
        plan.faults = [*MENDED, *HASHED]
        assert_equal(data, tiny)


@pytest.mark.parametrize(("fault", "reason"), [
    ("flipped", "00000000.json: expected SHA-256 .* fetched 3 times"), ("changed", "expected SHA-256"),
    ("elsewhere", "not followed"), ("endless", "cannot be read"), ("error", "HTTP status 503; tried 4 times"),
    ("bomb", "as gzip")])
def test_what_never_gets_better_is_an_error_that_names_the_shard(tiny: Path, fault: Fault, reason: str) -> None:
    with range_server(tiny) as upstream:
        plan = Plan(faults=[fault], in_a_row=99, only=r"\.tar")
        with fault_proxy(upstream, plan) as address:
            plan.rate = 0.0
            data = open_dataset(address)
            plan.rate = 1.0
            plan.faults = [fault]
            with pytest.raises(ShardError, match=rf"{STEM}-\w+\.tar: {reason}" if fault == "flipped" else reason):
                data.label("00000000")


def test_a_cache_that_cannot_be_written_is_named_with_what_to_do(tiny: Path, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with range_server(tiny) as address:
        with pytest.raises(OutputError, match=r"file: cannot .*XDG_CACHE_HOME, or keep nothing by a cache_size"):
            open_dataset(address, cache=tmp_path / "file")
        assert_equal(open_dataset(address, cache=tmp_path / "file", cache_size=0), tiny)


def test_the_cache_is_shared_and_hands_out_nothing_damaged(tiny: Path, tmp_path: Path) -> None:
    cache = tmp_path / "mine"
    with range_server(tiny) as upstream, fault_proxy(upstream, plan := Plan(rate=0.0)) as address:
        for _ in range(2):
            assert_equal(open_dataset(address, cache=cache), tiny)
        assert len([one for one in plan.served if one.path.endswith(".tar") and one.sent > 1]) == 4
        for path in cache.glob("??/[0-9a-f]*"):
            path.write_bytes(path.read_bytes()[:-1])
        assert_equal(open_dataset(address, cache=cache), tiny)
        kept = sum(path.stat().st_size for path in cache.glob("??/[0-9a-f]*"))
        assert_equal(open_dataset(address, cache=cache, cache_size=kept // 2), tiny)
        small = tmp_path / "small"
        assert_equal(open_dataset(address, cache=small, cache_size=kept // 2), tiny)
        assert sum(path.stat().st_size for path in small.glob("??/[0-9a-f]*")) <= kept // 2
        assert_equal(open_dataset(address, cache=tmp_path / "none", cache_size=0), tiny)
        assert not (tmp_path / "none").exists()


def _reader(address: str, cache: Path, begin: Any) -> None:
    data = open_dataset(address, cache=cache)
    begin.wait()
    for key in data.splits["train"]:
        data[key]


def test_processes_that_read_the_same_fetch_it_once(tiny: Path, tmp_path: Path) -> None:
    context = multiprocessing.get_context("forkserver")
    with range_server(tiny) as upstream, fault_proxy(upstream, plan := Plan(rate=0.0)) as address:
        begin = context.Barrier(2)
        readers = [context.Process(target=_reader, args=(address, tmp_path / "mine", begin)) for _ in range(2)]
        for reader in readers:
            reader.start()
        for reader in readers:
            reader.join()
            assert reader.exitcode == 0
    asked = Counter((one.path, one.range) for one in plan.served if one.range and one.range != "bytes=0-0")
    assert asked and set(asked.values()) == {1}


def test_labels_are_fetched_together_and_neighbours_at_once(tiny: Path) -> None:
    with range_server(tiny) as upstream, fault_proxy(upstream, plan := Plan(rate=0.0)) as address:
        data = open_dataset(address)
        before = len(plan.served)
        assert [label.key for label in data.labels(data.splits["train"])] == list(data.splits["train"])
        assert len(plan.served) - before == 2
        data.fetch(data.splits["train"])
        before = len(plan.served)
        assert [dict(data.images(key)).keys() for key in data.splits["train"]]
        assert len(plan.served) == before


def test_what_is_asked_of_an_address(tiny: Path) -> None:
    right = sha256_file(tiny / "dataset.json")
    with range_server(tiny) as address:
        for verify in ("off", "size", "shard"):
            with pytest.raises(ShardError, match=f"every file from an address is hashed, got {verify}"):
                open_dataset(address, verify=verify)  # type: ignore[arg-type]
        assert len(open_dataset(address, sha256=right)) == len(open_dataset(tiny, sha256=right.upper())) == 4
        for folder in (address, tiny):
            with pytest.raises(ShardError, match=f"expected SHA-256 {'0' * 64}, got {right}"):
                open_dataset(folder, sha256="0" * 64)
        with pytest.raises(ShardError, match="expected a finished dataset"):
            open_dataset(f"{address}/none")


Edit = Callable[[dict[str, Any]], object]


def _member(index: dict[str, Any], **changes: object) -> None:
    index["examples"][0]["members"][0].update(changes)


@pytest.mark.parametrize(("of_manifest", "of_index", "reason"), [
    (lambda m: m["shards"][0].update(name="../../x.tar"), None, "String should match pattern"),
    (lambda m: m.update(schema_version="9"), None, "Input should be '1'"),
    (lambda m: m["shards"][0].update(bytes=2**60), None, "less than 9007199254740992"),
    (lambda m: m["totals"].update(examples=10**9), None, "expected 1000000000 examples, the shards .* hold 4"),
    (lambda m: (m["totals"].update(examples=10**9 + 2), m["shards"][0].update(examples=10**9)),
     lambda i: i["shard"].update(examples=10**9), "expected the index of 1000000000 examples"),
    (lambda m: m["shards"].append(m["shards"][0]), None, "got one twice"),
    (None, lambda i: i["shard"].update(name="other-v1-train-000000-12345678.tar"), "expected the index of 2 examples"),
    (None, lambda i: _member(i, sha256="../../../x"), "expected the SHA-256 of"),
    (None, lambda i: _member(i, offset=0), "expected files after one another"),
    (None, lambda i: i["examples"][1]["members"][-1].update(size=2**30), "expected files within"),
    (None, lambda i: _member(i, size=2**40), "less than 2147483648"),
])
def test_hostile_manifests_and_indexes_are_refused_before_more_is_fetched(
        tiny: Path, tmp_path: Path, of_manifest: Edit | None, of_index: Edit | None, reason: str) -> None:
    """With sums that fit, as whoever made them would see to."""
    folder = tmp_path / "hostile"
    shutil.copytree(tiny, folder)
    index = index_path(folder, STEM)
    for path, change in ((folder / "dataset.json", of_manifest), (index, of_index)):
        if change:
            content = json.loads(path.read_text())
            change(content)
            path.write_text(json.dumps(content))
    _renew_sums(folder, index)
    with (range_server(folder) as upstream, fault_proxy(upstream, plan := Plan(rate=0.0)) as address,
          pytest.raises(ShardError, match=reason)):
        open_dataset(address)
    assert sum(one.sent for one in plan.served if one.path.endswith(".tar")) <= 3


def test_texts_that_are_too_deep_or_too_long_are_refused(tiny: Path, tmp_path: Path) -> None:
    folder = tmp_path / "hostile"
    shutil.copytree(tiny, folder)
    index, whole = index_path(folder, STEM), index_path(folder, STEM).read_bytes()
    index.write_bytes(b'{"a":' * 100_000 + b"1" + b"}" * 100_000)
    _renew_sums(folder, index)
    with range_server(folder) as address:
        with pytest.raises(ShardError, match="larger than 196,608 bytes"):
            open_dataset(address)
        index.write_bytes(b"[" * 50_000 + b"]" * 50_000)
        with pytest.raises(ShardError, match="recursion limit"):
            open_dataset(address)
        index.write_bytes(whole)
        (folder / "dataset.json").write_bytes(b" " * (2**26 + 1))
        with pytest.raises(ShardError, match="larger than 67,108,864 bytes"):
            open_dataset(address)


def test_a_shard_of_another_size_or_none_is_told_when_opened(tiny: Path, tmp_path: Path) -> None:
    folder = tmp_path / "cut"
    shutil.copytree(tiny, folder)
    shard = shard_path(folder, STEM)
    shard.write_bytes(shard.read_bytes()[:-512])
    with range_server(folder) as address:
        with pytest.raises(ShardError, match=rf"{address}/shards/{shard.name}: expected \d+ bytes, got \d+"):
            open_dataset(address)
        shard.unlink()
        with pytest.raises(ShardError, match=f"{address}/shards/{shard.name}: expected a file, found none"):
            open_dataset(address)


def _renew_sums(folder: Path, *changed: Path) -> None:
    lines = (folder / SUMS).read_text().splitlines()
    names = {path.relative_to(folder).as_posix() for path in (*changed, folder / "dataset.json")}
    (folder / SUMS).write_text("".join(f"{sha256_file(folder / name) if name in names else line[:64]}  {name}\n"
                                       for line in lines for name in [line[66:]]))
