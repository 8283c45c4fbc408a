"""The training loop: data in, one prediction, a loss and a step by phase, a check now and then, a checkpoint with it.

Everything random derives from the seed and the step, so that a training which was interrupted, however, goes on from
its last checkpoint to the same weights, bit by bit on one CPU with the same number of threads.
"""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import torch

from dataset_builder import __version__
from dataset_builder.digest import digest
from dataset_builder.errors import OutputError, Problem, UserError
from dataset_builder.files import write_atomic
from dataset_builder.lightnet.data import loader
from dataset_builder.lightnet.data.batch import Batch
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset, measured, splits_of
from dataset_builder.lightnet.methods.checkpoint import build_method, load_state, load_weights, save_state, spec_of
from dataset_builder.lightnet.methods.method import (
    Method,
    Precision,
    autocast,
    choose,
    precision_on,
    running_statistics,
)
from dataset_builder.lightnet.methods.vgg import file_digest
from dataset_builder.lightnet.settings import TrainingSpec, differences, flat
from dataset_builder.lightnet.training.events import Board, Checked, Event, Finished, Started, Stepped
from dataset_builder.lightnet.training.held_out_checks import HeldOutChecks
from dataset_builder.lightnet.training.optimise import Optimisers
from dataset_builder.lock import locked
from dataset_builder.seeding import derive_seed
from dataset_builder.shards.reader import load_manifest

LAST, BEST, LOG, SPEC, LOCK = "last.pt", "best.pt", "log.csv", "training.json", ".lock"
FREE = ("data.workers", "data.verify", "data.cache", "data.cache_gb", "most_bad_steps")
"""What may change between the runs of one training: who reads, how files are checked and kept, and when it gives up."""
ALONE = "the dataset has no split to hold out: no checks, and no best checkpoint"
SEED_BITS = 63
"""Of PyTorch's seeds."""


@dataclass(frozen=True, kw_only=True)
class TrainingJob:
    """What to train."""

    dataset: Path | str
    out: Path
    """A folder of its own."""
    spec: TrainingSpec
    vgg_weights: Path | None = None
    device: str = "auto"
    levels: tuple[int, ...] = ()
    """Noise levels to train and check on, all where empty."""
    keys: tuple[str, ...] = ()
    """Examples to train on, all where empty."""
    threads: int = 0
    """Of PyTorch, for the whole process; 0 leaves them as they are."""

    def identity(self) -> str:
        """Digest of whatever decides the weights, but for the machine and for what is `FREE`, which a user may have to
        change to go on."""
        vgg = file_digest(self.vgg_weights) if self.vgg_weights and self.spec.objective.fr else ""
        shards = [shard.sha256 for shard in load_manifest(self.dataset).shards]
        deciding = {key: value for key, value in flat(self.spec).items() if key not in FREE}
        some = {"keys": list(self.keys)} if self.keys else {}
        return digest({"spec": deciding, "shards": shards, "vgg": vgg, "levels": list(self.levels),
                       "package": __version__, **some})


@dataclass(kw_only=True)
class _Progress:
    """What changes while training, beside weights and moments."""

    step: int = 0
    history: list[dict[str, float]] = field(default_factory=list)
    best: tuple[int, float] = (0, float("-inf"))
    stale: int = 0
    """Checks since the best one."""
    bad_steps: int = 0


def fit(job: TrainingJob) -> Iterator[Event]:
    """Train, or go on with a training, yielding news; the files are in `job.out`.

    Raises UserError where the dataset lacks what is needed, where `out` holds another training or another process
    trains there, and where more steps than `most_bad_steps` had a loss or gradient that was not finite; checkpoints up
    to then are kept.
    """
    training = _Training(job)
    with locked(job.out / LOCK, folder=job.out, work="training"):
        training.go_on()
        yield training.started()
        if training.finished():
            yield training.end("already")
            return
        with closing(training.board):
            yield from training.run()


class _Training:
    """One training from its checkpoint, or from nothing, to its end."""

    def __init__(self, job: TrainingJob):
        data = job.spec.data.among(splits_of(job.dataset))
        spec = job.spec.model_copy(update={"data": data})
        self.job, self.spec, self.identity = job, spec, job.identity()
        self.device = choose(job.device)
        self.precision: Precision = precision_on(self.device, spec.precision)
        if job.threads:
            torch.set_num_threads(job.threads)
        self.train = LightingDataset(job.dataset, spec.data.train, spec.data, levels=job.levels, i_s=spec.data.i_s,
                                     keys=job.keys, extra=spec.extra)
        self.held_out = measured(job.dataset, data.held_out, data, job.levels) if data.held_out else None
        self.checks = HeldOutChecks(self.held_out, spec.check.examples) if self.held_out is not None else None
        self.method: Method = build_method(spec, job.vgg_weights).to(self.device)
        self.optimisers, self.running = Optimisers(self.method, spec), running_statistics(self.method)
        self.progress, self.first = _Progress(), 0

    def go_on(self) -> None:
        """Take up the checkpoint in `out`, if there is one. Raises OutputError where it is of another training."""
        path = self.job.out / LAST
        if path.exists():
            self._take_up(load_state(path), path)
        self.first = self.progress.step
        self.board = Board(self.job.out / "tensorboard", self.first)
        write_atomic(self.job.out / SPEC, self.spec.model_dump_json(indent=2).encode() + b"\n")

    def _take_up(self, state: dict[str, Any], path: Path) -> None:
        if state["identity"] != self.identity:
            rule = f"expected an earlier run of this training, got one with {self._other(spec_of(state, path))}"
            raise OutputError([Problem(where=str(path), path="", rule=rule, hint="choose another --out, or remove it")])
        load_weights(self.method, state["method"], path)
        self.optimisers.load(state["optimisers"])
        self.progress = _Progress(step=state["step"], history=list(state["history"]), stale=state["stale"],
                                  best=(int(state["best"][0]), state["best"][1]), bad_steps=state["bad_steps"])

    def _other(self, spec: TrainingSpec) -> str:
        """What tells a training with `spec` from this one."""
        changes = {key: values for key, values in differences(spec, self.spec).items() if key not in FREE}
        told = [f"{key} {there} instead of {here}" for key, (there, here) in changes.items()]
        return ", ".join(told) or "another dataset, other VGG weights or another version of this package"

    def started(self) -> Started:
        """What is about to be trained."""
        return Started(parameters=self.optimisers.counts(), first=self.first, steps=self.spec.steps,
                       train=len(self.train), held_out=len(self.held_out or ()), device=str(self.device),
                       precision=self.precision, off=self.method.off,
                       notes=tuple(dict.fromkeys((*self.train.notes,
                                                  *(self.held_out.notes if self.held_out else [ALONE])))))

    def run(self) -> Iterator[Event]:
        """All steps that are left, with their checks."""
        self.method.train()
        batches = loader.training_batches(self.train, self.spec, multiple=self.method.multiple, start_step=self.first)
        start = perf_counter()
        for batch in batches:
            waited = perf_counter() - start
            stepped = self._step(batch.to(self.device), start, waited)
            self.board.step(stepped)
            yield stepped
            if self.progress.step % self.spec.check.every == 0 or self.progress.step == self.spec.steps:
                yield self._check()
                if self._exhausted():
                    yield self.end("patience")
                    return
            start = perf_counter()
        yield self.end("steps")

    def _step(self, batch: Batch, start: float, waited: float) -> Stepped:
        step = self.progress.step
        # Dropout and its like depend on the step alone, so that nothing of them needs to be kept
        torch.manual_seed(derive_seed(self.spec.seed, "step", step) >> (64 - SEED_BITS))
        before = [statistic.clone() for statistic in self.running]
        with autocast(self.device, self.precision):
            prediction = self.method(batch.inputs)
        taken = self.optimisers.step(self.method, batch, prediction, step)
        self.progress.step = step + 1
        if taken.skipped:
            for statistic, kept in zip(self.running, before, strict=True):
                statistic.copy_(kept)
            self._count_bad(taken.skipped)
        return Stepped(step=step + 1, loss=taken.loss, terms=taken.terms, norm=taken.norm, rate=taken.rate,
                       skipped=taken.skipped, images=len(batch.keys), waited=waited, seconds=perf_counter() - start)

    def _count_bad(self, reason: str) -> None:
        self.progress.bad_steps += 1
        if self.progress.bad_steps > self.spec.most_bad_steps:
            raise UserError([Problem(where=str(self.job.out), path="most_bad_steps",
                                     rule=f"expected at most {self.spec.most_bad_steps} steps with a non-finite loss "
                                     f"or gradient, got {self.progress.bad_steps}; the last: {reason}",
                                     hint="lower optimiser.rate or optimiser.clip and train in a new folder, or raise "
                                          "most_bad_steps here")])

    def _check(self) -> Checked:
        """Measure on held-out examples, where there are some, and write the checkpoint."""
        progress = self.progress
        if self.checks is None:
            self._save(False)
            return Checked(step=progress.step, metrics={}, examples=0, best=False, stale=0)
        found = self.checks.measure(self.method, self.precision, self.device)
        better = (psnr := found["metrics"]["psnr"]) > progress.best[1]
        progress.stale = 0 if better else progress.stale + 1
        progress.best = (progress.step, psnr) if better else progress.best
        checked = Checked(step=progress.step, examples=len(self.checks), best=better, stale=progress.stale, **found)
        progress.history.append({"step": float(progress.step), **checked.figures})
        self._save(better)
        self.board.check(checked)
        return checked

    def _save(self, best: bool) -> None:
        progress, out = self.progress, self.job.out
        state = {"spec": self.spec.model_dump_json(), "identity": self.identity, "step": progress.step,
                 "dataset": self.train.name, "method": self.method.state_dict(),
                 "optimisers": self.optimisers.state(), "history": progress.history, "best": list(progress.best),
                 "stale": progress.stale, "bad_steps": progress.bad_steps, "off": list(self.method.off)}
        if best:
            save_state(out / BEST, state)
        # Last of all: whoever goes on from it finds everything else as it was then
        save_state(out / LAST, state)
        write_atomic(out / LOG, _log(progress.history).encode())

    def _exhausted(self) -> bool:
        return 0 < self.spec.check.patience <= self.progress.stale

    def finished(self) -> bool:
        """Whether an earlier run came to the end."""
        return self.progress.step >= self.spec.steps or self._exhausted()

    def end(self, reason: str) -> Finished:
        """The last news."""
        return Finished(step=self.progress.step, reason=reason, best=self.progress.best,
                        bad_steps=self.progress.bad_steps, last_file=self.job.out / LAST,
                        best_file=self.job.out / BEST)


def _log(history: list[dict[str, float]]) -> str:
    names = list(history[0]) if history else ["step"]
    lines = [",".join(f"{entry[name]:.6g}" for name in names) for entry in history]
    return "\n".join([",".join(names), *lines]) + "\n"
