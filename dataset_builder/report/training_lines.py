"""What the terminal shows of a training: a bar of steps, and lines that stay."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import chain, islice
from math import isfinite
from typing import TypeVar

from rich.console import Console, RenderableType
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.text import Text

from dataset_builder.errors import count_of
from dataset_builder.lightnet.training.events import Checked, Event, Finished, Started, Stepped
from dataset_builder.report.console import duration
from dataset_builder.report.noise_lines import CEILING
from dataset_builder.studies.trial_times import STEPS, Forecast, TimeLeft

News = TypeVar("News")
REASONS = {"steps": "all steps done", "patience": "no better check within the patience",
           "already": "already finished"}


class _Steps(Progress):
    """The text of a bar has a line of its own below it, so that 80 columns hold both."""

    def get_renderables(self) -> Iterator[RenderableType]:
        """The bars, and the text of each that is shown."""
        yield self.make_tasks_table(self.tasks)
        for task in self.tasks:
            if task.visible and task.fields["text"]:
                yield Text(task.fields["text"], no_wrap=True, overflow="ellipsis")


def bar_of_steps(console: Console) -> Progress:
    """A bar of steps, the time that has gone and is left, and a text of its own, the field `text`."""
    return _Steps(TextColumn("steps"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("left"),
                  TimeRemainingColumn(), console=console)


def follow_training(news: Iterable[News], console: Console, lines: Callable[[News], list[str]]) -> Iterator[News]:
    """Pass news on while the terminal shows the `lines` of each, and a progress bar from a training's start on."""
    coming = iter(news)
    begun = list(islice(coming, 1))
    with bar_of_steps(console) as progress:
        bar = progress.add_task("", total=None, text="", visible=False)
        for one in chain(begun, coming):
            if isinstance(one, Started):
                progress.update(bar, total=one.steps, completed=one.first, visible=True)
                progress.reset(bar, total=one.steps, completed=one.first)
            if isinstance(one, Stepped):
                progress.update(bar, completed=one.step, text=step_text(one))
            for line in lines(one):
                progress.console.print(line, highlight=False, markup=False, soft_wrap=True)
            yield one


def forecast_line(found: Forecast | None, count: int) -> str:
    """What `count` trainings are about to take."""
    if found is None:
        return f"{count_of(count, 'training')}: too few steps are left to time them beforehand"
    spread = f" ± {duration(found.error)}" if found.error >= 0.5 else ""
    return (f"{count_of(count, 'training')}, {found.steps:,} steps: about {duration(found.total)}{spread}, by "
            f"{count_of(STEPS, 'real step')} of each of {count_of(found.kinds, 'kind')}, at the load of now")


def left_text(left: TimeLeft | None, number: int, event: Event, steps: int) -> str:
    """How much time is left after a check of training `number`, to follow a line; empty after anything else."""
    if left is None or not isinstance(event, Checked):
        return ""
    return f"; about {duration(left.after(number, min(event.step / steps, 1)))} left"


def lines_of(event: Event) -> list[str]:
    """Lines that stay: of the start, of steps that were skipped, of checks and of the end."""
    if isinstance(event, Started):
        return started_lines(event)
    if isinstance(event, Stepped):
        return [f"step {event.step} skipped: {event.skipped}"] if event.skipped else []
    if isinstance(event, Checked):
        if not event.examples:
            return [f"step {event.step}: checkpoint"]
        line = f"step {event.step}, {event.examples} held-out examples: {_figures(event.metrics)}"
        noise = [f"{what}: {_figures(found)}" for what, found in (("without noise", event.corrected),
                                                                  (CEILING, event.ceiling)) if found]
        return ["; ".join([line + (" (best)" if event.best else ""), *noise])]
    return finished_lines(event)


def _figures(found: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:.4f}" for name, value in found.items())


def started_lines(event: Started) -> list[str]:
    """Sizes, device, and what is off."""
    sizes = ", ".join(f"{name} {count:,}" for name, count in event.parameters.items())
    lines = [f"parameters: {sizes}; {event.train} examples to train on, {event.held_out} held out; "
             f"{event.device}, {event.precision}"]
    lines += [*event.notes, *(f"off: {reason}" for reason in event.off)]
    return [*lines, f"resuming after step {event.first}"] if 0 < event.first < event.steps else lines


def finished_lines(event: Finished) -> list[str]:
    """Why it ended, the best check, and where the weights are."""
    end = f"{REASONS[event.reason]} at step {event.step}" + f", {event.bad_steps} steps skipped" * bool(event.bad_steps)
    if not isfinite(event.best[1]):
        return [end, f"last: {event.last_file}"]
    return [f"{end}; best on held-out examples: {event.best[1]:.2f} dB at step {event.best[0]}",
            f"last: {event.last_file}", f"best: {event.best_file}"]


def step_text(event: Stepped) -> str:
    """Losses, images per second and the share of time spent waiting for data."""
    losses = " ".join(f"{name} {value:.4f}" for name, value in (event.terms or event.loss).items())
    return f"{losses}  {event.images / event.seconds:.1f} images/s  {event.waited / event.seconds:.0%} waiting"
