"""Whole datasets: equal bytes, each fetched once, resumed, and whole or not there."""

from collections import Counter
from pathlib import Path

import pytest

from dataset_builder.cli.main import main
from dataset_builder.digest import sha256_file
from dataset_builder.errors import OutputError, ShardError, UserError
from dataset_builder.shards.reader import open_dataset
from dataset_builder.shards.verify import verify
from dataset_builder.transfer.choice import ExampleChoice
from dataset_builder.transfer.fetching import TransferProgress
from dataset_builder.transfer.pull import pull
from tests.shards.tiny_dataset import contents, make_example
from tests.transfer.conftest import CountingPlace, examples, made

CHUNK = 4096


def test_files_are_equal_and_come_once(place: CountingPlace, home: Path, tmp_path: Path) -> None:
    news = list[TransferProgress]()
    pulled = pull(place, tmp_path / "here", told=news.append, chunk_size=CHUNK)
    assert contents(tmp_path / "here") == contents(home)
    assert not (tmp_path / "here/.build/pull").exists()
    sizes = sum(shard.bytes for shard in pulled.manifest.shards)
    assert pulled.wanted == sizes == place.fetched(".tar")
    assert pulled.moved == sizes + place.fetched(".manifest")
    assert (news[-1].done, news[-1].total, news[-1].left) == (sizes, sizes, 0)
    place.log.clear()
    assert pull(place, tmp_path / "here").moved == 0
    assert {piece.name for piece in place.log} == {"dataset.json", "SHA256SUMS"}


def test_a_path_is_an_address(home: Path, tmp_path: Path) -> None:
    pull(str(home), tmp_path / "here")
    assert contents(tmp_path / "here") == contents(home)
    with pytest.raises(OutputError, match="another folder"):
        pull(home, home)


def test_finished_chunks_are_not_fetched_again(home: Path, tmp_path: Path) -> None:
    """Cut off again and again: every chunk is fetched once, but for those under way when it was cut."""
    left = 0

    def cut(name: str, start: int, data: bytes) -> bytes:
        nonlocal left
        left -= name.endswith(".tar")
        if left < 0:
            raise ConnectionResetError(104, "Connection reset by peer")
        return data

    place, runs = CountingPlace(home, cut), 0
    while True:
        left, runs = 9, runs + 1
        try:
            pull(place, tmp_path / "here", chunk_size=CHUNK)
            break
        except UserError as error:
            assert "Connection reset by peer" in str(error) and "kept" in str(error)
            assert not (tmp_path / "here/dataset.json").exists()
    assert contents(tmp_path / "here") == contents(home)
    asked = Counter(piece for piece in place.log if piece.name.endswith(".tar"))
    assert runs > 3
    assert sum(asked.values()) - len(asked) < runs * 18
    assert max(Counter(piece for piece in place.log if piece.name.endswith(".manifest")).values()) == 1


def test_a_partial_file_is_looked_at_before_it_counts(home: Path, tmp_path: Path) -> None:
    def cut(name: str, start: int, data: bytes) -> bytes:
        if name.endswith(".tar") and start >= 3 * CHUNK:
            raise OSError("gone")
        return data

    with pytest.raises(UserError):
        pull(CountingPlace(home, cut), tmp_path / "here", chunk_size=CHUNK)
    part = next((tmp_path / "here/.build/pull").glob("*.part"))
    data = bytearray(part.read_bytes())
    data[CHUNK + 5] ^= 1
    part.write_bytes(data)
    journal = part.with_name(f"{part.name}.chunks")
    journal.write_text(journal.read_text() + "7 torn\n99999999999999999999 x\n\0\n-1 a\n2")
    place = CountingPlace(home)
    pull(place, tmp_path / "here", chunk_size=CHUNK)
    assert contents(tmp_path / "here") == contents(home)
    assert not {0, 2 * CHUNK} & {piece.start for piece in place.log
                                 if sha256_file(home / piece.name) == part.name.partition(".")[0]}


@pytest.mark.parametrize("wrong", ["flipped", "shifted", "zeros"])
def test_wrong_bytes_are_fetched_again(wrong: str, home: Path, tmp_path: Path) -> None:
    """Of every shard some chunks are wrong the first time; most are fetched once all the same."""
    seen, spoilt = Counter[tuple[str, int]](), set[tuple[str, int]]()

    def once(name: str, start: int, data: bytes) -> bytes:
        seen[name, start] += 1
        if not name.endswith(".tar") or start % (6 * CHUNK) or seen[name, start] > 1:
            return data
        other = {"flipped": bytes([data[0] ^ 1]) + data[1:], "shifted": data[1:] + data[:1], "zeros": bytes(len(data))}
        spoilt.update([(name, start)] if other[wrong] != data else [])
        return other[wrong]

    pull(CountingPlace(home, once), tmp_path / "here", chunk_size=CHUNK)
    assert contents(tmp_path / "here") == contents(home)
    times = {key: count for key, count in seen.items() if key[0].endswith(".tar")}
    assert spoilt <= {key for key, count in times.items() if count == 2}
    assert len(spoilt) >= 8
    assert sum(times.values()) < 1.6 * len(times)


def test_bytes_that_stay_wrong_are_a_reason(home: Path, tmp_path: Path) -> None:
    spoilt = next(home.glob("shards/*test-000000*"))

    def always(name: str, start: int, data: bytes) -> bytes:
        return data[:-1] + bytes([data[-1] ^ 4]) if name.endswith(spoilt.name) and start == CHUNK else data

    with pytest.raises(UserError, match=f"{spoilt.name}: expected SHA-256 .* differed 3 times"):
        pull(CountingPlace(home, always), tmp_path / "here", chunk_size=CHUNK)
    assert not (tmp_path / "here/dataset.json").exists()
    place = CountingPlace(home)
    pull(place, tmp_path / "here", chunk_size=CHUNK)
    assert {(piece.name, piece.start) for piece in place.log if piece.name.endswith(".tar")} <= {
        (f"shards/{spoilt.name}", start) for start in (0, CHUNK, 2 * CHUNK)}


def test_a_shorter_answer_is_a_reason(home: Path, tmp_path: Path) -> None:
    place = CountingPlace(home, lambda name, start, data: data[:-1] if name.endswith(".tar") else data)
    with pytest.raises(UserError, match="cannot be read"):
        pull(place, tmp_path / "here")


def test_a_newer_version_fetches_what_differs(home: Path, tmp_path: Path) -> None:
    pull(home, tmp_path / "here")
    newer = made(tmp_path / "newer/tiny", chosen={**examples(), 4: make_example(4, view="train/000002", light=0)})
    place = CountingPlace(newer)
    pull(place, tmp_path / "here")
    assert contents(tmp_path / "here") == contents(newer)
    fetched = {piece.name for piece in place.log if piece.name.endswith(".tar")}
    assert len(fetched) == 1 and "train-000001" in fetched.pop()


def test_damage_here_is_mended(home: Path, tmp_path: Path) -> None:
    pull(home, tmp_path / "here")
    spoilt = next((tmp_path / "here").glob("shards/*train-000000*"))
    data = bytearray(spoilt.read_bytes())
    data[700] ^= 1
    spoilt.chmod(0o644)
    spoilt.write_bytes(data)
    place = CountingPlace(home)
    pull(place, tmp_path / "here")
    assert contents(tmp_path / "here") == contents(home)
    assert {piece.name for piece in place.log if piece.name.endswith(".tar")} == {f"shards/{spoilt.name}"}


def test_refusals_leave_the_folder_alone(home: Path, tmp_path: Path) -> None:
    here = tmp_path / "here"
    misspelt = ExampleChoice(split=("trian",))
    for arguments, message in [({"sha256": "0" * 64}, "another dataset or version"),
                               ({"most": 1000}, "most 1,000 bytes"),
                               ({"choice": misspelt}, r"split: .* \(train, test\), got 'trian'")]:
        with pytest.raises(UserError, match=message):
            pull(home, here, **arguments)
        assert not here.exists()
    here.mkdir()
    (here / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match=r"other files: mine\.txt"):
        pull(home, here)
    assert contents(here) == {"mine.txt": b"mine"}
    with pytest.raises(ShardError, match="found no such file"):
        pull(tmp_path / "nowhere", tmp_path / "there")
    assert pull(home, tmp_path / "there", sha256=sha256_file(home / "dataset.json").upper()).moved


def test_what_is_pulled_is_a_dataset(home: Path, tmp_path: Path) -> None:
    pull(home, tmp_path / "here")
    assert verify(tmp_path / "here") == []
    assert len(open_dataset(tmp_path / "here", verify="shard")) == 12


@pytest.mark.parametrize("words", [("pull", "tiny"), ("export", "tiny"), ("push",), ("build", "a.yaml", "--out"),
                                   ("merge", "a.yaml", "tiny", "--out")], ids=lambda words: words[0])
def test_an_address_is_no_folder_to_work_in(words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                            capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    more = {"export": ("--format", "dali"), "push": ("there",)}.get(words[0], ())
    with pytest.raises(SystemExit) as ended:
        main([*words, "s3://me:secret@bucket/tiny", *more])
    said = capsys.readouterr().err
    assert ended.value.code == 2 and "on this machine, got the address s3://bucket/tiny" in said
    assert "secret" not in said and not list(tmp_path.iterdir())
