"""Batches for training, read ahead by other processes, and whole frames for looking at results.

A batch depends on the seed and the step alone, and not on the process that reads it. Workers are forked from a server
process that has loaded PyTorch once and never had a thread: a fork of the training process would inherit its pools of
threads, and a fresh interpreter takes seconds to start. They write pictures into memory that is shared from start to
end, since fresh pages can cost as much as what is written to them.
"""

import multiprocessing
import warnings
from collections import deque
from collections.abc import Iterator, Sequence
from multiprocessing.context import BaseContext
from typing import Any

import torch
from torch.utils.data import DataLoader, Dataset

from dataset_builder.errors import Problem, UserError
from dataset_builder.lightnet.data.assemble import Chosen, Notes, Shape, assemble, batch_of, fill
from dataset_builder.lightnet.data.augment import Draw, draws_of, epoch_draws, variation_of, window_about, window_side
from dataset_builder.lightnet.data.batch import Batch
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.processes import follow_the_parent

AHEAD = 2
"""Batches that each worker is ahead."""
DEATH = "DataLoader worker"
"""How PyTorch begins to tell that a worker has died."""


def training_batches(dataset: LightingDataset, spec: TrainingSpec, *, multiple: int,
                     start_step: int = 0) -> Iterator[Batch]:
    """One batch per step from `start_step` on, up to `spec.steps`; sides are multiples of `multiple`.

    Processes that read ahead end with the iterator. Raises UserError as reading an example does, whichever process
    reads it, and where a process dies.
    """
    source = _Source(dataset, spec, multiple)
    steps = range(start_step, spec.steps)
    if not spec.data.workers:
        return (assemble(source.chosen(step), source.shape) for step in steps)
    return _read_ahead(source, steps, spec.data.workers)


def whole_images(dataset: LightingDataset, indices: Sequence[int]) -> Iterator[Batch]:
    """Batches of one by position in the dataset: whole frames, as they are, of any size."""
    return (dataset[index] for index in indices)


class _Source:
    """What the batch of a step is made of."""

    def __init__(self, dataset: LightingDataset, spec: TrainingSpec, multiple: int):
        self._dataset, self._spec = dataset, spec
        side = window_side(spec.data.crop, *dataset.size, multiple=multiple)
        self.shape = Shape(count=spec.data.batch, height=side, width=side, extra=dataset.extra)

    def chosen(self, step: int) -> Iterator[Chosen]:
        """Its examples, read one after the other."""
        draws = draws_of(step, size=self.shape.count, count=len(self._dataset), seed=self._spec.seed)
        self._dataset.fetch(draw.example for draw in draws)
        return map(self._choose, draws)

    def _choose(self, draw: Draw) -> Chosen:
        part = self._dataset.part(draw.example)
        draws = epoch_draws(len(self._dataset), self._spec.seed, draw.epoch)
        variation = variation_of(self._spec.data, draws[draw.example])
        return part, variation, window_about(part.inside, self.shape.height, variation)


def _read_ahead(source: _Source, steps: range, workers: int) -> Iterator[Batch]:
    ring = torch.empty((workers * AHEAD + 1, source.shape.numbers)).share_memory_()
    free = deque(range(len(ring)))
    with warnings.catch_warnings():
        # More processes than cores, which is for the user to say
        warnings.filterwarnings("ignore", message="This DataLoader will create", category=UserWarning)
        loader = DataLoader(
            _Reader(source, ring), batch_sampler=_Orders(steps, free), num_workers=workers, prefetch_factor=AHEAD,
            collate_fn=_as_it_is, multiprocessing_context=_context(), worker_init_fn=follow_the_parent,
            # PyTorch draws a seed for its workers, which nobody uses: not from the generator that dropout draws from
            generator=torch.Generator(),
        )
        orders: Any = iter(loader)
    try:
        for _ in steps:
            place, notes = _next(orders)
            memory = torch.from_numpy(ring[place].numpy().copy())
            free.append(place)
            yield batch_of(memory, notes, source.shape)
    finally:
        # Nothing public ends the processes while an exception that somebody keeps refers to their iterator
        orders._shutdown_workers()


class _Orders:
    """What PyTorch calls a batch sampler: a step, and a free place of the ring for its pictures, when they are asked
    for."""

    def __init__(self, steps: range, free: deque[int]):
        self._steps, self._free = steps, free

    def __len__(self) -> int:
        return len(self._steps)

    def __iter__(self) -> Iterator[list[int]]:
        return ([step, self._free.popleft()] for step in self._steps)


class _Reader(Dataset[Any]):
    """What a worker does: read a step's examples into a place of the ring.

    An error that a user can act on is handed over as it is; PyTorch would rewrite it.
    """

    def __init__(self, source: _Source, ring: torch.Tensor):
        self._source, self._ring = source, ring

    def __getitems__(self, order: list[int]) -> tuple[int, Notes] | UserError:
        step, place = order
        try:
            return place, fill(self._ring[place], self._source.chosen(step), self._source.shape)
        except UserError as error:
            return error


def _next(orders: Iterator[tuple[int, Notes] | UserError]) -> tuple[int, Notes]:
    try:
        found = next(orders)
    except RuntimeError as error:
        if not str(error).startswith(DEATH):
            raise
        hint = ("not enough memory or /dev/shm: set `data.workers` to 0 or `data.batch` lower; or your script runs "
                "code outside `if __name__ == \"__main__\":`")
        raise UserError([Problem(where="", path="data.workers", rule=f"a process that reads ahead died ({error})",
                                 hint=hint)]) from error
    if isinstance(found, UserError):
        raise found
    return found


def _context() -> BaseContext:
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__])
    return context


def _as_it_is(found: Any) -> Any:
    return found
