"""How far a build is, in a terminal or a log: examples, rate, time left, what was rejected, noise, and every field that
is in the making."""

from collections.abc import Callable, Iterable, Iterator
from time import monotonic

from rich.console import Console, RenderableType
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from dataset_builder.builder import Event
from dataset_builder.engine.field_tasks import FieldNews
from dataset_builder.errors import printable
from dataset_builder.label.mean_told import means_told
from dataset_builder.report.build_standing import BuildStanding
from dataset_builder.report.console import duration

OFTEN = 0.5
"""Seconds between two looks at what lines below the bars say."""

SELDOM, SHARE, LONGEST = 30.0, 0.01, 600.0
"""Seconds between two lines of a log and share of the examples between them, both at least, and seconds at most."""


class Following:
    """Shows a build's news: bars on a terminal, a line now and then elsewhere. standing: what is known of the build,
    for whoever shows it, too; clock: seconds."""

    def __init__(self, console: Console, standing: BuildStanding | None = None,
                 clock: Callable[[], float] = monotonic):
        self._console, self._clock = console, clock
        self._standing = standing or BuildStanding(start=clock())
        self._bars, self._progress = dict[str, TaskID](), _Bars(self._standing, console, clock)
        self._looked, self._line = float("-inf"), (clock(), 0)
        self._gates = set[str]()

    def field(self, news: FieldNews) -> None:
        """Show how far a field is."""
        if (now := news.progress) is None:
            return
        name = f"{news.kind} field of {news.object}: {now.stage}"
        rate = f"loss {now.loss:.4f}, {now.psnr:.1f} dB" if now.stage == "fit" else ""
        if not self._console.is_terminal:
            if self._clock() - self._line[0] >= SELDOM:
                self._print(f"{name} {now.step}/{now.steps}{f', {rate}' if rate else ''}")
            return
        if news.key not in self._bars:
            self._bars[news.key] = self._progress.add_task(name, total=now.steps, rate="")
        self._progress.update(self._bars[news.key], description=name, total=now.steps, completed=now.step, rate=rate)

    def refresh(self) -> None:
        """Draw the bars now."""
        self._progress.refresh()

    def events(self, events: Iterable[Event]) -> Iterator[Event]:
        """Pass events on while they are shown, out of as many examples as the first one wants."""
        if not self._console.is_terminal:
            yield from self._logged(events)
            return
        with self._progress as progress:
            bar = progress.add_task("examples", total=None, rate="")
            for event in events:
                self._take(event)
                progress.update(bar, total=self._standing.wanted, completed=self._standing.done,
                                rate=rate_text(self._standing.rate(self._clock())))
                if self._clock() - self._looked >= OFTEN:
                    self._look()
                yield event
            self._look()

    def _logged(self, events: Iterable[Event]) -> Iterator[Event]:
        for event in events:
            self._take(event)
            now, (then, done), standing = self._clock(), self._line, self._standing
            if event.outcomes and now - then >= SELDOM and (
                    now - then >= LONGEST or standing.done - done >= SHARE * (standing.wanted or 0)):
                self._print(summary(standing, now))
            yield event
        if self._standing.done:
            self._print(summary(self._standing, self._clock(), ended=True))

    def _take(self, event: Event) -> None:
        self._standing.add(event, self._clock())
        if event.field:
            if event.field.key in self._bars:
                self._progress.remove_task(self._bars.pop(event.field.key))
            self._console.print(field_line(event.field), highlight=False, soft_wrap=True)

    def _look(self) -> None:
        self._looked, self._progress.lines = self._clock(), tuple(standing_lines(self._standing))

    def _print(self, line: str) -> None:
        """Print a line, before it the first example of every gate that refused none before."""
        self._line = self._clock(), self._standing.done
        for gate in self._standing.refused.keys() - self._gates:
            self._gates.add(gate)
            first = self._standing.refused[gate].first[0]
            self._console.print(f"first rejected by {gate}: {first.key}: {first.reason}", highlight=False,
                                soft_wrap=True)
        self._console.print(line, highlight=False, soft_wrap=True)


class _Bars(Progress):
    """Bars, and lines about the build below them."""

    def __init__(self, standing: BuildStanding, console: Console, clock: Callable[[], float]):
        self.lines: tuple[str, ...] = ()
        super().__init__(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
                         TextColumn("{task.fields[rate]}"), TimeElapsedColumn(), _Left(standing, clock),
                         console=console)

    def get_renderables(self) -> Iterable[RenderableType]:
        """What is drawn, from the top."""
        yield from super().get_renderables()
        for line in self.lines:
            yield Text(printable(line), no_wrap=True, overflow="ellipsis")


class _Left(TimeRemainingColumn):
    """Time left: of a build as its standing has it, of a field by its steps."""

    def __init__(self, standing: BuildStanding, clock: Callable[[], float]):
        super().__init__()
        self._standing, self._clock = standing, clock

    def render(self, task: Task) -> Text:
        """Of one bar."""
        left = task.time_remaining if task.id else self._standing.left(self._clock())
        return Text("" if left is None else f"{duration(left)} left", style="progress.remaining")


def summary(standing: BuildStanding, now: float, *, ended: bool = False) -> str:
    """A line on a build: examples, rate, time left or taken, what was rejected, noise."""
    left = standing.left(now)
    parts = [f"{standing.done}/{standing.wanted if standing.wanted is not None else '?'} examples",
             rate_text(standing.rate(now, ended=ended)),
             duration(now - standing.start) if ended else f"{duration(left)} left" if left is not None else ""]
    gates = ", ".join(f"{gate} {refused.count}" for gate, refused in standing.refused.items())
    return "; ".join([", ".join(filter(None, parts)), *([f"rejected {standing.rejected} ({gates})"] if gates else []),
                      *noise_lines(standing)])


def standing_lines(standing: BuildStanding) -> Iterator[str]:
    """What there is to say besides a bar: a line for each gate that refused something, and the noise."""
    for gate, refused in standing.refused.items():
        yield f"rejected {refused.count} by {gate}, first {refused.first[0].key}: {refused.first[0].reason}"
    yield from noise_lines(standing)


def noise_lines(standing: BuildStanding) -> Iterator[str]:
    """Median relative error of every layer with light; how goals ended, where there are any; means not known."""
    if standing.noise:
        yield "noise " + ", ".join(f"{layer} {spread.median:.1%}" for layer, spread in standing.noise.items())
    if goals := standing.goals:
        yield "sampling stopped by " + ", ".join(f"{name} {share:.0%}" for name, share in goals.items())
    if standing.unknown:
        yield means_told(standing.unknown)


def rate_text(rate: float | None) -> str:
    """Examples by time, in digits that say something: `2.31/s`, `4.2/min`, `11/h`."""
    for seconds, unit, digits in ((1, "s", 2), (60, "min", 1)):
        if rate and rate * seconds >= 1:
            return f"{rate * seconds:.{digits}f}/{unit}"
    return f"{rate * 3600:.3g}/h" if rate else ""


def field_line(news: FieldNews) -> str:
    """What became of a field, in a line."""
    name, record = f"{news.kind} field of {news.object}", news.record
    if record is None:
        return f"no {name}: {news.failed}"
    spent = ", ".join(f"{step} {duration(seconds)}" for step, seconds in news.seconds.items()) or "was there"
    return (f"{name}: {record.psnr:.1f} dB (worst {record.psnr_worst:.1f}), opacity IoU {record.opacity_iou:.3f}, "
            f"mesh IoU {record.silhouette_iou:.3f} in {record.bodies} {'body' if record.bodies == 1 else 'bodies'}; "
            f"{spent}")
