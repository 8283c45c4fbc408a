"""A page that shows a build while it runs, written over every few seconds. Whatever befalls it, the build goes on."""

import re
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from time import monotonic, time
from typing import Any, Literal

from dataset_builder.builder import Event
from dataset_builder.engine.field_tasks import FieldNews
from dataset_builder.errors import UserError
from dataset_builder.files import commit, write_partial
from dataset_builder.processes import cores, machine, processor
from dataset_builder.report.build_progress import rate_text
from dataset_builder.report.build_standing import BuildStanding
from dataset_builder.report.console import duration
from dataset_builder.report.front.fill_page import fill
from dataset_builder.report.rate_curve import rate_curve
from dataset_builder.report.small_pictures import small_picture
from dataset_builder.shards.staging import Staging

TEMPLATE, SCRIPTS = "watched_build.html", ("scripts/watched_build.js",)
STYLES = ("styles/page.css", "styles/watched_build.css")

EVERY = 5.0
"""Seconds between two writings, and between two pictures of examples."""

HEARD = 3
"""Writings that a build that runs may be late by."""
WRITTEN = re.compile(rb'<main data-state="running" data-written="([0-9]+[.][0-9])"')

PICTURES = 8
"""Examples that are shown, the last ones."""

State = Literal["running", "finished", "stopped", "interrupted"]


@dataclass(frozen=True, kw_only=True)
class _Picture:
    key: str
    said: str
    source: str


class WatchedPage:
    """The page of one build. about: what else to say of it, such as its spec; folder: that it builds into; warn: told
    once if the page cannot be written; staged: where finished examples wait."""

    def __init__(self, path: Path, standing: BuildStanding, *, name: str, about: Mapping[str, str], folder: Path,
                 staged: Staging, warn: Callable[[str], None]):
        self._path, self._standing, self._warn = path, standing, warn
        here = f"{machine()['host']}: {processor()}, {cores()} cores"
        self._name, self._about = name, {**about, "machine": here, "begun": f"{datetime.now().astimezone():%F %T %Z}"}
        self._folder, self._staged = folder, staged
        self._fields = dict[str, FieldNews]()
        self._pictures, self._pictured = deque[_Picture](maxlen=PICTURES), float("-inf")
        self._ended, self._warned, self._writing = threading.Event(), False, threading.Lock()
        self._thread = threading.Thread(target=self._renew, daemon=True)

    def begin(self) -> None:
        """Write the page, and again every few seconds from now on. Warns where another build may be writing it."""
        age = _running_age(self._path)
        if age is not None and age < HEARD * EVERY:
            self._warn(f"warning: the page {self._path} was written {age:.0f} s ago by a build that had not ended; if "
                       "it still runs, both write over it: name another --html for one of them")
        self._write("running")
        self._thread.start()

    def field(self, news: FieldNews) -> None:
        """Take note of how far a field is."""
        with self._standing.lock:
            self._fields[news.key] = news

    def events(self, events: Iterable[Event]) -> Iterator[Event]:
        """Pass events on that the standing knows already."""
        for event in events:
            if event.field:
                self.field(event.field)
            if event.outcomes and monotonic() - self._pictured >= EVERY:
                self._picture(event)
            yield event

    def end(self, state: State, reasons: Sequence[str] = ()) -> None:
        """Write the page for the last time: how the build ended, and why."""
        self._ended.set()
        self._write(state, reasons)

    def _renew(self) -> None:
        while not self._ended.wait(EVERY):
            self._write("running")

    def _write(self, state: State, reasons: Sequence[str] = ()) -> None:
        with self._writing:
            if state == "running" and self._ended.is_set():
                return
            try:
                text = fill(TEMPLATE, scripts=SCRIPTS, styles=STYLES, **self._values(state, reasons))
                # A page of a moment ago is no loss in a power cut
                write_partial(self._path, [text.encode()], flush=False)
                commit(self._path, flush=False)
            except (UserError, OSError, ValueError, RuntimeError, ArithmeticError, MemoryError) as error:
                if not self._warned:
                    self._warn(f"warning: the page {self._path} is not up to date ({error}); the build goes on")
                self._warned = True

    def _values(self, state: State, reasons: Sequence[str]) -> dict[str, Any]:
        """What the template shows, as text."""
        standing, now = self._standing, monotonic()
        with standing.lock:
            left, wanted = standing.left(now), standing.wanted
            top = max((spread.median for spread in standing.noise.values()), default=0.0)
            return {
                "title": f"{self._name}: {state}", "name": self._name, "state": state, "reasons": list(reasons),
                "about": self._about, "every": EVERY, "written": f"{time():.1f}",
                "written_text": f"{datetime.now().astimezone():%F %T %Z}", "done": standing.done, "wanted": wanted,
                "kept": standing.kept, "share": standing.done / wanted if wanted else float(wanted == 0),
                "rate": rate_text(standing.rate(now, ended=state != "running")),
                "elapsed": duration(now - standing.start),
                "left": "" if left is None or state != "running" else duration(left),
                "rejected": standing.rejected, "gates": standing.refused,
                "noise": [(name, f"{spread.median:.2%}", spread.median / top if top else 0.0)
                          for name, spread in standing.noise.items()],
                "goals": [(name, f"{share:.0%}") for name, share in standing.goals.items()],
                "fields": [_field_row(news) for news in self._fields.values()], "pictures": list(self._pictures),
                "curve": rate_curve(standing.curve)}

    def _picture(self, event: Event) -> None:
        """Keep a picture of one example of an event, before its shard is published."""
        for outcome in reversed(event.outcomes):
            if not outcome.kept and (source := small_picture(outcome, self._folder, self._staged)):
                said = f"rejected by {outcome.rejected.gate}" if outcome.rejected else outcome.ref.view.name
                self._pictures.append(_Picture(key=outcome.ref.key, said=said, source=source))
                self._pictured = monotonic()
                return


def _running_age(path: Path) -> float | None:
    """Seconds since a build that had not ended wrote the page; None where there is no such page."""
    try:
        found = WRITTEN.search(path.read_bytes())
    except OSError:
        return None
    return max(0.0, time() - float(found[1])) if found else None


def _field_row(news: FieldNews) -> tuple[str, str, float]:
    """Name of a field, how far it is, and as a share."""
    name = f"{news.kind} field of {news.object}"
    if news.progress:
        return name, f"{news.progress.stage} {news.progress.step}/{news.progress.steps}", \
            news.progress.step / max(news.progress.steps, 1)
    return name, f"{news.record.psnr:.1f} dB" if news.record else f"failed: {news.failed}", 1.0
