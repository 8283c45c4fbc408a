"""mlcroissant: hashes of shards, splits, and layers as far as it decodes them; what it cannot do is said here."""

import shutil
from pathlib import Path
from typing import Any

import pytest

from tests.ecosystem.pages import PAGE, Truth, equal, pixels

mlcroissant = pytest.importorskip("mlcroissant", reason="needs mlcroissant, which brings pandas")
pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture
def folder(dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy, and a cache of its own: mlcroissant unpacks whole shards."""
    from etils import epath

    monkeypatch.setattr("mlcroissant._src.operation_graph.operations.extract.EXTRACT_PATH",
                        epath.Path(tmp_path / "extract"))
    return Path(shutil.copytree(dataset, tmp_path / "copy"))


def records(folder: Path, name: str) -> list[dict[str, Any]]:
    """Records of a set."""
    return [*mlcroissant.Dataset(jsonld=str(folder / "croissant.json")).records(name)]


def with_bytes(folder: Path, name: str) -> list[dict[str, Any]]:
    """Records as the page says: pixels are called text, which mlcroissant hands over as bytes."""
    page = PAGE.read_text().partition("import mlcroissant\n")[2].partition("for record in")[0]
    changed = str(folder.parent / "bytes.json")
    exec(page.replace("datasets/3df-lighting-mini", str(folder)).replace("bytes.json", changed))
    return [*mlcroissant.Dataset(jsonld=changed).records(name)]


def causes(error: BaseException | None) -> list[str]:
    found = []
    while error is not None:
        found.append(str(error))
        error = error.__cause__ or error.__context__
    return found


def test_splits(folder: Path, truth: Truth) -> None:
    splits = [example["meta"]["split"] for example in truth.values()]
    assert records(folder, "splits") == [{"splits/name": name, "splits/examples": splits.count(name)}
                                         for name in ("train", "test")]


def test_layers_as_bytes(folder: Path, truth: Truth) -> None:
    """Every example of both splits, once `content` is called text: EXR is an image that it does not know."""
    found = {record["i_t/key"].decode(): record["i_t/content"] for record in with_bytes(folder, "i_t")}
    assert set(found) == set(truth)
    assert all(equal(pixels(data), truth[key]["i_t"]) for key, data in found.items())


def test_it_does_not_decode_exr(folder: Path) -> None:
    with pytest.raises(mlcroissant.GenerationError) as caught:
        records(folder, "i_t")
    assert any("cannot identify image file" in text for text in causes(caught.value))


def test_it_does_not_read_json_inside_a_shard(folder: Path) -> None:
    with pytest.raises(mlcroissant.GenerationError) as caught:
        records(folder, "label")
    assert any('Column "$.split" does not exist' in text for text in causes(caught.value))


def test_a_damaged_shard_is_refused(folder: Path) -> None:
    shard = min((folder / "shards").iterdir())
    shard.chmod(0o644)
    data = bytearray(shard.read_bytes())
    data[700] ^= 1
    shard.write_bytes(data)
    with pytest.raises(mlcroissant.GenerationError) as caught:
        with_bytes(folder, "i_t")
    assert any(text.startswith("Hash of downloaded file") for text in causes(caught.value))
