"""A damaged dataset is mended from its spec: exactly the broken examples are rendered, and the bytes are the same."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from dataset_builder.errors import ShardError
from dataset_builder.shards.publish import published
from dataset_builder.shards.reader import load_manifest
from dataset_builder.shards.shard_index import ExampleRecord
from dataset_builder.shards.verify import verify
from dataset_builder.shards.writer import index_path, shard_path
from dataset_builder.spec.load import load_dataset
from dataset_builder.transfer import rerender
from dataset_builder.transfer.anchor import Repaired
from tests.small_specs import contents, run_build, write_spec
from tests.whole.test_edits import FILES

TWO = "splits.train.lights=2"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of ten examples, two in a shard, beside its spec; not to be changed."""
    root = tmp_path_factory.mktemp("rerender")
    run_build(write_spec(root / "spec", FILES), root / "whole", TWO)
    return root / "whole"


@pytest.fixture
def broken(whole: Path, tmp_path: Path) -> Path:
    """A copy to damage, as it was downloaded: no result of a pass is remembered."""
    shutil.copytree(whole, tmp_path / "broken", ignore=shutil.ignore_patterns(".build"))
    return tmp_path / "broken"


def mend(whole: Path, folder: Path, *overrides: str) -> Repaired:
    loaded = load_dataset(whole.parent / "spec" / "small.yaml", [TWO, *overrides])
    return rerender.repair_with(loaded, folder, backend="llvm", workers=1)


def stems(folder: Path) -> list[str]:
    return [shard.stem for shard in load_manifest(folder).shards]


def examples(folder: Path, stem: str) -> tuple[ExampleRecord, ...]:
    index = published(folder, stem)
    assert index is not None
    return index.examples


def flip(path: Path, at: int) -> None:
    data = bytearray(path.read_bytes())
    data[at] ^= 1
    path.write_bytes(data)


def test_only_the_example_with_a_broken_member_is_rendered(whole: Path, broken: Path) -> None:
    stem = stems(whole)[0]
    chosen = examples(whole, stem)[1]
    flip(shard_path(broken, stem), chosen.members[2].offset + 30)
    (broken / "README.md").unlink()
    (broken / "mine.txt").write_text("x")
    done = mend(whole, broken)
    assert done.rendered == (chosen.key,) and done.aside == ("mine.txt",)
    assert set(done.mended) == {"README.md", f"shards/{stem}.tar"}
    assert contents(broken) == contents(whole) and verify(broken) == []
    again = mend(whole, broken)
    assert again == Repaired()


@pytest.mark.parametrize(("damage", "rendered"), [
    (lambda folder, stem: [(folder / name).unlink() for name in ("dataset.json", "croissant.json")], 0),
    (lambda folder, stem: flip(folder / "SHA256SUMS", 3), 0),
    (lambda folder, stem: flip(shard_path(folder, stem), 100), 0),
    (lambda folder, stem: flip(index_path(folder, stem), 700), 0),
    (lambda folder, stem: [index_path(folder, stem).unlink(), (folder / "SHA256SUMS").unlink()], 0),
    (lambda folder, stem: [(folder / "dataset.json").unlink(), shard_path(folder, stem).unlink()], 2),
], ids=["dataset.json", "sums", "header", "index", "index and sums", "dataset.json and a shard"])
def test_what_is_whole_is_not_rendered(whole: Path, broken: Path, damage: Callable[[Path, str], None],
                                       rendered: int) -> None:
    stem = stems(whole)[0]
    damage(broken, stem)
    done = mend(whole, broken)
    assert contents(broken) == contents(whole) and len(done.rendered) == rendered


def test_another_spec_and_other_versions_are_refused_and_nothing_is_changed(
        whole: Path, broken: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stem = stems(whole)[0]
    flip(shard_path(broken, stem), 700)
    (broken / "mine.txt").write_text("x")
    before = contents(broken)
    with pytest.raises(ShardError, match=r"expected the spec that dataset.json names"):
        mend(whole, broken, "seed=2")
    with monkeypatch.context() as patch:
        patch.setattr(rerender, "versions", lambda backend, spec: {"numpy": "1.0"})
        with pytest.raises(ShardError, match=r"expected the versions that made it: .*numpy: .*, here 1\.0"):
            mend(whole, broken)
    assert contents(broken) == before
    (broken / "dataset.json").unlink()
    before.pop("dataset.json")
    with pytest.raises(ShardError, match=r"expected the spec that .* was built from"):
        mend(whole, broken, "seed=2")
    # A machine that makes other bytes: what a build makes of the spec is not what was published
    monkeypatch.setattr(rerender, "_require_same_maker", lambda *args: None)
    with pytest.raises(ShardError, match="expected the one with SHA-256"):
        mend(whole, broken, "title=another")
    assert contents(broken) == before
