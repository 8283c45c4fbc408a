"""Running units, in this process or in several: what every engine keeps to."""

import logging
import math
import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from dataset_builder.engine import local, ray_cluster
from dataset_builder.errors import OutputError, SpecError
from dataset_builder.processes import cores
from dataset_builder.spec.load import load_dataset
from tests.engine.ray_machines import cluster_of

Run = Callable[..., Iterator[Any]]
ENGINES = (local.run, ray_cluster.run)
# Ray leaves what it opened for its processes to the collector
pytestmark = [pytest.mark.filterwarnings("ignore::ResourceWarning"),
              pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")]


@pytest.fixture(scope="module", params=ENGINES, ids=lambda run: run.__module__)
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """Every way to run units; on Ray, one cluster for all tests."""
    if request.param is local.run:
        yield request.param
        return
    with cluster_of(1, tmp_path_factory.mktemp("machine"), cpus=2):
        yield request.param


def test_one_worker_is_this_process_and_keeps_the_order() -> None:
    started: list[int] = []
    results = local.run(lambda unit: started.append(unit) or -unit, [3, 1, 2], workers=1)
    assert next(results) == -3 and started == [3]
    assert list(results) == [-1, -2]


def test_several_do_every_unit_once(run: Run) -> None:
    assert sorted(run(abs, range(-12, 0), workers=2)) == list(range(1, 13))
    assert list(run(abs, [], workers=2)) == []


def test_what_goes_wrong_in_a_process_comes_back_whole(run: Run, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"math domain error|nonnegative"):
        list(run(math.sqrt, [4.0, -1.0], workers=2))
    with pytest.raises(SpecError, match=r"none\.yaml: expected a file, found none") as caught:
        list(run(load_dataset, [tmp_path / "none.yaml"], workers=2))
    assert [problem.rule for problem in caught.value.problems] == ["expected a file, found none"]


class Unit:
    """What a process is to do: end in some way as often as said, each time noted in a folder, or be done."""

    def __init__(self, name: str, folder: Path, end: str = "", times: int = 0):
        self.name, self.folder, self.end, self.times = name, folder, end, times

    def __str__(self) -> str:
        return self.name

    def tries(self) -> int:
        """How often it was begun."""
        return len(list(self.folder.glob(f"{self.name}.*")))


def do(unit: Unit) -> str:
    """Note who tries, and what else runs; then end."""
    number = unit.tries()
    if number < unit.times:
        (unit.folder / f"{unit.name}.{number}").touch()
        if unit.end == "exit":
            os._exit(9)
        if unit.end == "hang":
            # As a library does that waits for itself: no signal that can be caught ends it
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
            time.sleep(600)
        os.kill(os.getpid(), getattr(signal, unit.end))
    return unit.name


def test_a_unit_whose_process_dies_is_tried_again_and_the_others_go_on(run: Run, tmp_path: Path,
                                                                       caplog: pytest.LogCaptureFixture) -> None:
    fine = [Unit(f"fine {number}", tmp_path) for number in range(6)]
    shaky = [Unit("once", tmp_path, "SIGSEGV", 1), Unit("twice", tmp_path, "SIGKILL", 2)]
    with caplog.at_level(logging.WARNING):
        done = list(run(do, [fine[0], *shaky, *fine[1:]], workers=2))
    assert sorted(done) == sorted(map(str, [*fine, *shaky])) and [unit.tries() for unit in shaky] == [1, 2]
    said = [record.getMessage() for record in caplog.records]
    assert run is not local.run or (
        len(said) == 3 and any("once" in line and "segmentation fault" in line for line in said))


def test_a_unit_that_always_dies_is_named_after_all_others_are_done(run: Run, tmp_path: Path) -> None:
    bad = Unit("bad", tmp_path, "SIGKILL", 99)
    results, done = run(do, [bad, *(Unit(f"fine {number}", tmp_path) for number in range(5))], workers=2), []
    with pytest.raises(OutputError, match=r"^bad: its process was killed.*, 3 times \(what was finished is") as caught:
        for each in results:
            done.append(each)
    assert len(caught.value.problems) == 1 and bad.tries() == 3 and len(done) == 5


def test_how_a_process_of_this_machine_ended_is_said(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"exits: its process ended by itself \(exit code 9\), 3 times"):
        list(local.run(do, [Unit("exits", tmp_path, "exit", 99)], workers=2))
    with pytest.raises(OutputError, match=r"^bad: its process was killed \(signal 9\), as the system does when memory "
                                          r"runs out \(fewer --workers need less\), 3 times \(what was finished is"):
        list(local.run(do, [Unit("bad", tmp_path, "SIGKILL", 99)], workers=2))


def test_a_unit_that_hangs_is_killed_and_named(run: Run, tmp_path: Path) -> None:
    units = [Unit("stuck", tmp_path, "hang", 99), Unit("slow once", tmp_path, "hang", 1), Unit("fine", tmp_path)]
    done = list[str]()
    with pytest.raises(OutputError, match=r"stuck: its process was killed.* took longer than 0.3 s, 3 times"):
        for each in run(do, units, workers=1, limit=lambda unit: 0.3 if unit.end else 60.0):
            done.append(each)
    assert sorted(done) == ["fine", "slow once"] and units[0].tries() == 3


def blocks_interrupts(unit: int) -> bool:
    """Whether Ctrl-C was blocked before this process ran anything."""
    return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_a_process_is_deaf_to_an_interrupt_from_its_first_moment_on() -> None:
    assert list(local.run(blocks_interrupts, [0], workers=2)) == [True] and not blocks_interrupts(0)


def test_where_most_units_are_lost_it_is_not_the_units(tmp_path: Path) -> None:
    units = [Unit(f"bad {number}", tmp_path, "exit", 99) for number in range(40)]
    with pytest.raises(OutputError, match=r"bad \d+: its process ended by itself") as caught:
        list(local.run(do, units, workers=2))
    assert len(caught.value.problems) < 20


def test_there_is_a_core() -> None:
    assert 1 <= cores() <= (os.cpu_count() or 1)
