"""Rows of a study that obey known laws, with noise where it is asked for."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dataset_builder.studies.accuracy.dataset_work import DatasetWork
from dataset_builder.studies.accuracy.rows import OTHERS, WHOLE, AccuracyRow

PIXELS = 1000


def sampled(question: str, spp: float, *, fixed: float = 0.0, gain: float = 1.0, bias: float = 0.0, floor: float = 0.0,
            example: str = "00000000", spread: float = 0.0, layer: str = "i_t", value: float | None = None,
            replicate: int = 0) -> AccuracyRow:
    """A row that obeys Monte Carlo's law: relMSE 1 / (gain spp) + bias, a second for 100 spp and a fixed time."""
    relmse, seconds = 1 / (gain * spp) + bias, fixed + spp / 100
    return AccuracyRow(question=question, setting=f"{spp:g}", value=spp if value is None else value, example=example,
                       layer=layer, seconds=seconds, cpu_seconds=seconds, spp=spp, spp_min=spp - spread,
                       spp_max=spp + spread, paths=spp * PIXELS, relmse=relmse, relmse_measured=relmse + floor,
                       relmse_reference=floor, floor=floor, psnr=30.0, flip=0.1, replicate=replicate,
                       reached=relmse**0.5)


def uniform(**law: float) -> list[AccuracyRow]:
    """The uniform curve from 1 to 1024 spp."""
    return [sampled("uniform", 4.0**k, **law) for k in range(6)]


def study(noises: Sequence[float] = (1.0, 1.0, 1.0, 1.0), layers: Sequence[str] = ("i_t", "s_prime"),
          runs: int = 3) -> list[AccuracyRow]:
    """Uniform sampling and goals of one example whose relMSE at one sample is 1, and other examples with these."""
    rows = []
    for layer in layers:
        for run in range(runs):
            rows += [sampled("uniform", spp, layer=layer, fixed=0.05, replicate=run) for spp in (4, 16, 64, 256)]
            # A goal g ends at error g / 2 with the samples that uniform sampling needs for it
            rows += [sampled("adaptive", 4 / goal**2, layer=layer, fixed=0.05, value=goal, spread=1, replicate=run)
                     for goal in (0.4, 0.2, 0.1)]
        rows += [replace(sampled(OTHERS, 16, gain=1 / noise, fixed=0.05, example=f"{number:08d}"), layer=layer)
                 for number, noise in enumerate(noises)]
    rows += [AccuracyRow(question=OTHERS, setting="16", value=16, example=f"{number:08d}", layer=WHOLE, seconds=1.0,
                         cpu_seconds=1.0) for number in range(len(noises))]
    return rows


def jittered(rows: Sequence[AccuracyRow], deviation: float, seed: int) -> list[AccuracyRow]:
    """The same with timings that scatter."""
    factors = np.exp(np.random.default_rng(seed).normal(0, deviation, len(rows)))
    return [replace(row, seconds=row.seconds * factor, cpu_seconds=row.cpu_seconds * factor)
            for row, factor in zip(rows, factors.tolist(), strict=True)]


def work(examples: int = 100) -> DatasetWork:
    """Views of `PIXELS` pixels, one example each."""
    passes = ("source", "target", "rough")
    return DatasetWork(examples=examples, views=examples, tried=examples, runs=dict.fromkeys(passes, examples),
                       pixels=dict.fromkeys(passes, float(examples * PIXELS)), spp=dict.fromkeys(passes, 64),
                       bytes={"float32": 2e9, "float16": 1e9}, error=0.0, fields=0.0,
                       rates={"path": 1e-5, "launch": 0.05, "view": 0.4, "example": 0.0})
