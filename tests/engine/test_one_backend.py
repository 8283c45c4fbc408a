"""Examples of another backend are not made again without a word."""

from collections.abc import Iterator
from pathlib import Path
from shutil import copytree
from typing import Any

import pytest

from dataset_builder import builder
from dataset_builder.engine.made_by import versions
from dataset_builder.engine.one_backend import BACKEND
from dataset_builder.errors import OutputError
from dataset_builder.shards.folder import WORK
from dataset_builder.shards.staging import Staging
from dataset_builder.spec.load import load_dataset
from tests.small_specs import contents


class StartedError(Exception):
    """The engine was asked for work."""


def no_engine(work: Any, units: Any, **_: Any) -> Iterator[Any]:
    if list(units):
        raise StartedError
    return iter(())


@pytest.fixture
def folder(small_dataset: Path, tmp_path: Path) -> Path:
    """The small dataset, which the CPU made."""
    return Path(copytree(small_dataset, tmp_path / "small"))


@pytest.fixture
def on_a_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    """Versions as a machine with a GPU has them."""
    monkeypatch.setattr(builder, "versions",
                        lambda *given: versions(*given) | {"variant": "cuda_ad_rgb", "llvm": ""})


def resume(spec: Path, folder: Path, **how: Any) -> int:
    """How many examples a build would make, which ends there."""
    events = builder.build(load_dataset(spec), folder, backend="llvm", workers=1, run=no_engine, **how)
    wanted = next(events).wanted
    events.close()
    assert wanted is not None
    return wanted


def test_the_backend_that_made_a_dataset_finds_it_whole(small_spec: Path, folder: Path) -> None:
    assert resume(small_spec, folder) == 0


@pytest.mark.usefixtures("on_a_gpu")
@pytest.mark.parametrize("noted", [True, False])
def test_another_backend_is_refused_until_it_is_told(small_spec: Path, folder: Path, noted: bool) -> None:
    """As a build left it, and as it was fetched: without what builds note for each other."""
    if not noted:
        (folder / WORK / BACKEND).unlink()
    before = contents(folder)
    for only in ((), (3,)):
        with pytest.raises(OutputError) as refused:
            resume(small_spec, folder, only=only)
        text = str(refused.value)
        assert "expected examples of cuda_ad_rgb, which renders here, got 10 made by llvm_ad_rgb" in text
        assert "all 10 would be made again" in text and "--backend llvm" in text and "--replace" in text
    assert contents(folder) == before
    assert resume(small_spec, folder, replace_other=True) == 10
    # Told once, it goes on, although the dataset of the other one is still there
    assert resume(small_spec, folder) == 10 and contents(folder) == before


@pytest.mark.usefixtures("on_a_gpu")
def test_what_is_staged_counts(small_spec: Path, folder: Path) -> None:
    Staging(folder).put("00000001", "0" * 64, b"segment", {"key": "00000001"})
    with pytest.raises(OutputError, match="got 11 made by llvm_ad_rgb"):
        resume(small_spec, folder)


@pytest.mark.usefixtures("on_a_gpu")
def test_a_spec_that_changed_is_made_again_whoever_made_it(small_spec: Path, folder: Path) -> None:
    spec = load_dataset(small_spec, ("seed=2",))
    events = builder.build(spec, folder, backend="llvm", workers=1, run=no_engine)
    assert next(events).wanted == 10
    events.close()


@pytest.mark.parametrize("damage", [b"", b"{}", b'{"variant":"cuda_ad_rgb"}', b"[]"])
def test_a_damaged_note_says_nothing(small_spec: Path, folder: Path, damage: bytes) -> None:
    (folder / WORK / BACKEND).write_bytes(damage)
    assert resume(small_spec, folder) == 0
