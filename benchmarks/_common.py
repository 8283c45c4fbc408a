"""What the benchmarks share: one embedded scene, and times as the best of several runs."""

from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter

from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.plan import plan_example
from dataset_builder.rendering import plugins
from dataset_builder.rendering.backend import activate
from dataset_builder.spec.load import load_dataset

ROOT = Path(__file__).resolve().parent.parent
MINI = ROOT / "scene_specs" / "3df-lighting-mini.yaml"


def start(threads: int = 0) -> None:
    """Switch the renderer on and say which; threads = 0 is all cores."""
    print(f"backend: {activate('auto', threads).summary}")
    plugins.register()


def plan(index: int, *overrides: str) -> ExamplePlan:
    """The plan of one example of the mini dataset, with overrides as `--set` takes them."""
    return plan_example(load_dataset(MINI, overrides), index)


def seconds(work: Callable[[], object], clock: Callable[[], float] = perf_counter) -> float:
    """Time of one call by a clock; wall time by default."""
    begin = clock()
    work()
    return clock() - begin


def best(works: Sequence[Callable[[], object]], repeats: int = 5,
         clock: Callable[[], float] = perf_counter) -> list[float]:
    """Shortest time of each, run in turn so that a drifting machine drifts for all; one round of warming up first."""
    for work in works:
        work()
    rounds = [[seconds(work, clock) for work in works] for _ in range(repeats)]
    return [min(times) for times in zip(*rounds, strict=True)]
