"""How far a build is, with rate and time left: its examples, and every field that is in the making."""

from collections.abc import Iterable, Iterator

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from dataset_builder.builder import Event
from dataset_builder.engine.field_tasks import FieldNews
from dataset_builder.report.console import duration


class Following:
    """A progress bar of a build's examples, and of every field that is in the making."""

    def __init__(self, console: Console):
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
                   TextColumn("{task.fields[rate]}"), TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn())
        self._console, self._progress = console, Progress(*columns, console=console)
        self._bars = dict[str, TaskID]()

    def field(self, news: FieldNews) -> None:
        """Show how far a field is."""
        if (now := news.progress) is None:
            return
        name = f"{news.kind} field of {news.object}: {now.stage}"
        if news.key not in self._bars:
            self._bars[news.key] = self._progress.add_task(name, total=now.steps, rate="")
        rate = f"loss {now.loss:.4f}, {now.psnr:.1f} dB" if now.stage == "fit" else ""
        self._progress.update(self._bars[news.key], description=name, total=now.steps, completed=now.step, rate=rate)

    def refresh(self) -> None:
        """Draw the bars now."""
        self._progress.refresh()

    def events(self, events: Iterable[Event]) -> Iterator[Event]:
        """Pass events on while they are shown, out of as many examples as the first one wants."""
        with self._progress as progress:
            bar = progress.add_task("examples", total=None, rate="")
            for event in events:
                if event.field:
                    self._finished(event.field)
                task = next(task for task in progress.tasks if task.id == bar)
                speed = task.finished_speed or task.speed
                progress.update(bar, total=task.total if event.wanted is None else event.wanted,
                                advance=len(event.outcomes), rate=f"{speed:.2f}/s" if speed else "")
                yield event

    def _finished(self, news: FieldNews) -> None:
        if news.key in self._bars:
            self._progress.remove_task(self._bars.pop(news.key))
        self._console.print(field_line(news), highlight=False, soft_wrap=True)


def field_line(news: FieldNews) -> str:
    """What became of a field, in a line."""
    name, record = f"{news.kind} field of {news.object}", news.record
    if record is None:
        return f"no {name}: {news.failed}"
    spent = ", ".join(f"{step} {duration(seconds)}" for step, seconds in news.seconds.items()) or "was there"
    return (f"{name}: {record.psnr:.1f} dB (worst {record.psnr_worst:.1f}), opacity IoU {record.opacity_iou:.3f}, "
            f"mesh IoU {record.silhouette_iou:.3f} in {record.bodies} {'body' if record.bodies == 1 else 'bodies'}; "
            f"{spent}")
