"""A capture that is as it should be, and a copy to spoil."""

from pathlib import Path

import pytest

from tests.capture_review import MADE


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture with masks in a folder of their own; not to be changed."""
    return MADE.write_transforms(tmp_path_factory.mktemp("good") / "good")


@pytest.fixture
def copied(good: Path, tmp_path: Path) -> Path:
    """The same, to be changed."""
    folder = tmp_path / "copied"
    for path in sorted(good.rglob("*")):
        if path.is_file():
            (folder / path.relative_to(good)).parent.mkdir(parents=True, exist_ok=True)
            (folder / path.relative_to(good)).write_bytes(path.read_bytes())
    return folder
