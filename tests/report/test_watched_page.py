"""The page of a build: what it says while the build runs, and how it ends; nothing about it ends the build."""

import argparse
import json
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from re import findall, search

import pytest
from rich.console import Console

from dataset_builder.builder import Event
from dataset_builder.cli.interrupt import guarded, last_words
from dataset_builder.cli.main import main
from dataset_builder.cli.watched import followed
from dataset_builder.engine.unit import Outcome
from dataset_builder.errors import OutputError, Problem
from dataset_builder.planning.catalogue import ExampleRef, PairRef, ViewRef
from dataset_builder.report import watched_page
from dataset_builder.shards.manifest import Rejected
from dataset_builder.spec.load import load_dataset
from tests.small_specs import write_spec

HOSTILE = "</script><b onload=alert(1)>&'\""


def outcome(index: int, reason: str = "") -> Outcome:
    ref = ExampleRef(index=index, view=ViewRef(number=index, camera=0, pair=PairRef(split="train", object=0, scene=0)),
                     light=0, level=0)
    rejected = Rejected(key=ref.key, view=ref.view.name, gate="coverage", reason=reason) if reason else None
    return Outcome(ref=ref, rejected=rejected, seconds={"target": 1.0}, noise={"i_t": ("error", 0.0312)})


def events() -> Iterator[Event]:
    """Of ten examples five, one of them refused."""
    yield Event(wanted=10)
    for index in range(4):
        yield Event(outcomes=(outcome(index),))
    yield Event(outcomes=(outcome(4, HOSTILE),))


def watch(tmp_path: Path, page: Path, news: Iterator[Event]) -> str:
    """Follow news to their end; what the terminal said."""
    said = StringIO()
    loaded = load_dataset(write_spec(tmp_path / "spec"), [f"title={json.dumps(HOSTILE)}"])
    options = argparse.Namespace(html=page, spec=tmp_path / "spec" / "small.yaml")
    with followed(options, loaded, tmp_path / "out", Console(file=said, width=200)) as (_, follow):
        list(follow(news))
    return said.getvalue()


def state(page: Path) -> str:
    """The state that a page says."""
    found = search('<main data-state="([a-z]+)"', page.read_text())
    return found[1] if found else ""


def test_a_page_says_how_the_build_is_and_that_it_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watched_page, "EVERY", 0.01)
    page, seen = tmp_path / "pages" / "small.html", []

    def news() -> Iterator[Event]:
        seen.append(state(page))
        yield from events()

    watch(tmp_path, page, news())
    text = page.read_text()
    assert seen == ["running"] and state(page) == "finished" and not list(page.parent.glob("*.partial"))
    assert "5 <small>of 10</small>" in text and 'style="width: 50.00%"' in text
    assert "coverage: 1" in text and "3.12%" in text and "error (100%)" in text
    # What specs and gates say is text, also where the digest of the spec is
    assert HOSTILE not in text and text.count("&lt;/script&gt;&lt;b onload=alert(1)&gt;&amp;") >= 2
    assert "small 1.0.0" not in text and len(findall("[0-9a-f]{64}", text)) == 1


def test_two_builds_on_one_page_are_told(tmp_path: Path) -> None:
    page, said = tmp_path / "small.html", list[str]()

    def news() -> Iterator[Event]:
        yield from events()
        said.append(watch(tmp_path, page, events()))

    assert "had not ended" not in watch(tmp_path, page, news())
    assert f"the page {page} was written" in said[0] and "name another --html" in said[0]
    assert "had not ended" not in watch(tmp_path, page, events()), "one that ended is written over"
    page.write_text(page.read_text().replace('data-state="finished"', 'data-state="running"').replace(
        'data-written="', 'data-written="1.0" data-old="'))
    assert "had not ended" not in watch(tmp_path, page, events()), "one that died long ago, too"


@pytest.mark.parametrize(("error", "reason"), [
    (OutputError([Problem(where="view train/000003", path="", rule="its process was killed by SIGKILL, 3 times")]),
     "view train/000003: its process was killed by SIGKILL, 3 times"),
    (RuntimeError("<i>no</i>"), "RuntimeError: &lt;i&gt;no&lt;/i&gt;"),
])
def test_a_build_that_fails_says_why_on_its_page(tmp_path: Path, error: Exception, reason: str) -> None:
    def news() -> Iterator[Event]:
        yield from events()
        raise error

    with pytest.raises(type(error)):
        watch(tmp_path, tmp_path / "small.html", news())
    assert state(tmp_path / "small.html") == "stopped" and reason in (tmp_path / "small.html").read_text()


def test_an_interrupt_is_said_whatever_a_library_makes_of_it(tmp_path: Path) -> None:
    def news(error: type[BaseException]) -> Iterator[Event]:
        yield from events()
        raise error

    with pytest.raises(KeyboardInterrupt):
        watch(tmp_path, tmp_path / "one.html", news(KeyboardInterrupt))
    assert state(tmp_path / "one.html") == "interrupted"

    def work() -> int:
        try:
            import _thread
            _thread.interrupt_main()
            watch(tmp_path, tmp_path / "two.html", news(ImportError))
        except KeyboardInterrupt:
            watch(tmp_path, tmp_path / "two.html", news(ImportError))
        return 0

    assert guarded(work) == 130
    assert state(tmp_path / "two.html") == "interrupted"


def test_a_page_that_cannot_be_written_is_a_warning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watched_page, "EVERY", 0.01)
    (tmp_path / "file").write_text("")
    said = watch(tmp_path, tmp_path / "file" / "small.html", events())
    assert said.count("warning") == 1 and "the build goes on" in said and "5/10 examples" in said


def test_last_words_are_taken_back() -> None:
    said = list[str]()
    with last_words(lambda: said.append("now")):
        pass
    assert guarded(lambda: 0) == 0 and said == []


@pytest.mark.parametrize(("name", "rule"), [
    ("pages.html", "expected a file, got the folder"),
    ("out/small.html", "expected a file outside"),
    ("out/.build/../small.html", "expected a file outside"),
    ("small.yaml", "expected a file that ends in .html"),
    ("s3://bucket/small.html", "expected a path on this machine"),
])
def test_a_page_that_would_take_the_place_of_something_is_refused(
        tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, name: str,
        rule: str) -> None:
    spec = write_spec(tmp_path)
    before = spec.read_text()
    (tmp_path / "pages.html").mkdir()
    monkeypatch.chdir(tmp_path)
    try:
        code = main(["build", str(spec), "--out", "out", "--html", name])
    except SystemExit as ended:
        code = int(ended.code or 0)
    assert code == 2 and rule in capsys.readouterr().err
    assert not (tmp_path / "out").exists() and spec.read_text() == before
