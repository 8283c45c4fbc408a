"""Finished examples that wait elsewhere than in the output folder: the same rules."""

from pathlib import Path

import pytest

from dataset_builder.errors import OutputError, UserError
from dataset_builder.remote.file_box import UrlBox
from dataset_builder.shards.staging import Staging


@pytest.fixture(params=["", "memory://staging", "file://{}/place"])
def staging(request: pytest.FixtureRequest, tmp_path: Path) -> Staging:
    """Staging of every kind of place."""
    pytest.importorskip("fsspec")
    found = Staging(tmp_path, request.param.format(tmp_path))
    found.clear()
    return found


def test_what_is_put_is_there_until_it_is_dropped(staging: Staging) -> None:
    staging.put("00000001", "a", b"bytes", {"key": "00000001"})
    staging.put("00000002", "b", b"more", {"key": "00000002"})
    assert staging.get("00000001", "a").segment == b"bytes" and staging.has("00000002", "b")
    assert not staging.has("00000001", "b") and not staging.has("00000003", "a")
    assert staging.known() == {"00000001": "a", "00000002": "b"} and staging.size() > 9
    staging.put("00000001", "c", b"newer", {"key": "00000001"})
    assert staging.known() == {"00000001": "c", "00000002": "b"}
    staging.drop("00000001")
    assert staging.known() == {"00000002": "b"}
    staging.clear()
    assert staging.known() == {} and staging.size() == 0


def test_what_was_damaged_is_not_there(staging: Staging) -> None:
    staging.put("00000001", "a", b"bytes", {"key": "00000001"})
    assert staging.has("00000001", "a")
    staging._box.write("00000001.a.segment", b"bytez")
    assert not staging.has("00000001", "a")


def test_a_place_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"nowhere://x: --staging: expected a place that can be written, got: "):
        Staging(tmp_path, "nowhere://user:secret@x")
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        Staging(tmp_path, f"file://{tmp_path}/file/below").put("1", "a", b"", {})


def test_an_address_with_file_is_the_folder_that_it_stands_for(tmp_path: Path) -> None:
    Staging(tmp_path, f"file://{tmp_path}/a%20b").put("00000001", "a", b"", {})
    assert len(list((tmp_path / "a b").iterdir())) == 2
    with pytest.raises(UserError, match="expected file:///PATH, without a host"):
        Staging(tmp_path, f"file://elsewhere{tmp_path}")


def test_what_a_library_says_is_told_without_secrets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    staging = Staging(tmp_path, "memory://staging")
    assert isinstance(staging._box, UrlBox)

    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("403 from https://me:secret@host/bucket?X-Amz-Signature=secret")

    monkeypatch.setattr(staging._box._files, "pipe_file", fail)
    with pytest.raises(OutputError, match="got: RuntimeError: 403 from https://host/bucket ") as told:
        staging.put("00000001", "a", b"", {})
    assert "secret" not in str(told.value)


def test_a_path_may_be_given_for_an_address(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from dataset_builder.cli.engine import _staging

    monkeypatch.chdir(tmp_path)
    assert _staging("a b") == f"{tmp_path.as_uri()}/a%20b" and _staging("s3://b/c") == "s3://b/c" and not _staging("")
