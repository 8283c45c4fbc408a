"""What people type that cannot be meant: refused before anything is fetched or written."""

from pathlib import Path

import pytest

from dataset_builder.cli.main import main
from dataset_builder.errors import OutputError
from dataset_builder.transfer.pull import pull
from dataset_builder.transfer.push import push


@pytest.mark.parametrize("words", [("--layers", ""), ("--layers", "i_t,"), ("--split", ""), ("--object", "")])
def test_an_empty_name_does_not_mean_everything(words: tuple[str, str], home: Path, tmp_path: Path,
                                                capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["pull", str(home), str(tmp_path / "to"), *words]) == 2
    assert "got ''" in capsys.readouterr().err and not (tmp_path / "to").exists()


@pytest.mark.parametrize("words", [("to", "--pin", "abc"), ("to", "--pin", ""), ("",)])
def test_digests_and_folders_are_checked_for_their_form(words: tuple[str, ...], home: Path, tmp_path: Path,
                                                        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit):
        main(["pull", str(home), *words])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("inside", [".", "more", "shards/more"])
def test_a_dataset_gets_no_other_inside(inside: str, home: Path) -> None:
    before = sorted(home.rglob("*"))
    with pytest.raises(OutputError, match="outside of the dataset to pull from"):
        pull(home, home / inside)
    with pytest.raises(OutputError, match="outside of the dataset to push"):
        push(home, home / inside)
    assert sorted(home.rglob("*")) == before
