"""Questions 7 and 8: what the types and codecs of files cost, and whether sums drift.

Storage is measured on whole examples as the dataset has them.

Sums are taken of the very samples of a picture: many pixels with one sample each are, read as a list in random order,
what one large pixel would sum. The sum in float32, one after the other, is compared with the one in float64, and with
what the renderer does: float32 within a batch, float64 from there on.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from math import isqrt
from time import perf_counter
from typing import TypeVar

import numpy as np

from dataset_builder.errors import ShardError
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.rendering.sampling.adaptive import BATCH_SIZES
from dataset_builder.seeding import rng
from dataset_builder.shards import exr
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.studies.accuracy.curves import Advice
from dataset_builder.studies.accuracy.rows import WHOLE, AccuracyRow, of
from dataset_builder.studies.accuracy.workbench import PLAIN, Bench
from dataset_builder.studies.image_errors import relative_mse
from dataset_builder.studies.renders import render
from dataset_builder.studies.sampled import rerendered

CODECS = "codecs"
Result = TypeVar("Result")


def measure_storage(bench: Bench, ref: ExampleRef) -> Iterator[AccuracyRow]:
    """One row for each type and codec over all layers together, and the error of half in each layer."""
    plan = bench.spec.plan(ref, *PLAIN)
    layers = render(plan, bench.spec.mesh_root).layers
    for dtype in exr.DTYPES:
        try:
            kept = {name: exr.stored(image, layer=name, key=plan.key, dtype=dtype) for name, image in layers.items()}
        except ShardError as error:
            yield AccuracyRow(question=CODECS, setting=f"{dtype}: {error}", value=math.nan, example=plan.key,
                              layer=WHOLE)
            continue
        for codec in exr.CODECS:
            yield _codec_row(kept, codec, dtype, plan.key, bench.budget.codec_repeats)
        for name, image in layers.items():
            everywhere = np.ones(image.shape[:2], dtype=bool)
            lost = relative_mse(kept[name], image, everywhere)
            yield AccuracyRow(question=CODECS, setting=dtype, value=math.nan, example=plan.key, layer=name, relmse=lost,
                              relmse_measured=lost, relmse_reference=0.0, floor=0.0)


def _codec_row(kept: dict[str, np.ndarray], codec: str, dtype: exr.DType, key: str, repeats: int) -> AccuracyRow:
    files, encoding = _best(lambda: {name: exr.compress(image, layer=name, key=key, dtype=dtype, codec=codec)
                                     for name, image in kept.items()}, repeats)
    back, decoding = _best(lambda: {name: exr.decode(data) for name, data in files.items()}, repeats)
    lossy = [name for name, image in kept.items() if back[name].tobytes() != image.tobytes()]
    if lossy:
        raise ShardError(f"codec {codec}: expected the same bits back, got others in {', '.join(lossy)}")
    return AccuracyRow(question=CODECS, setting=f"{dtype} {codec}", value=math.nan, example=key, layer=WHOLE,
                       bytes=sum(map(len, files.values())), encode_seconds=encoding, decode_seconds=decoding)


def _best(work: Callable[[], Result], repeats: int) -> tuple[Result, float]:
    """What `work` gives, and the least of its times."""
    times = []
    for _ in range(repeats):
        start = perf_counter()
        result = work()
        times.append(perf_counter() - start)
    return result, min(times)


ACCUMULATION, SUMMED = "accumulation", "i_t"
RUNNING, BATCHED, NOISE = "float32 throughout", "float32 in batches, float64 across", "standard error of the mean"


def measure_sums(bench: Bench, ref: ExampleRef) -> Iterator[AccuracyRow]:
    """Relative drift of both kinds of sum, and the noise that the mean has anyway, at every length."""
    plan = one_sample_each(bench.plan(ref, layers={SUMMED: "frame"}), max(bench.budget.counts))
    # One sample has no error that could be known, and the record's figures are not wanted here
    with np.errstate(invalid="ignore"):
        pixels = render(plan, bench.spec.mesh_root).layers[SUMMED].mean(axis=2).ravel()
    samples = rng(int(plan.render.seed), "order").permutation(pixels)
    for count in bench.budget.counts:
        part = samples[:count]
        for name, value in zip((RUNNING, BATCHED, NOISE), drifts(part, max(BATCH_SIZES)), strict=True):
            yield AccuracyRow(question=ACCUMULATION, setting=name, value=count, example=plan.key, layer=SUMMED,
                              drift=value)


def one_sample_each(plan: ExamplePlan, count: int) -> ExamplePlan:
    """The same picture with at least `count` pixels and one sample in each."""
    side = isqrt(count - 1) + 1
    return rerendered(plan, width=side, height=side, batches=1, spp_first_hit=1, spp_source=1, spp_target=1,
                      spp_rough=1)


def drifts(samples: np.ndarray, batch: int) -> tuple[float, float, float]:
    """For (N,) float32 samples >= 0: relative difference from the float64 sum of the float32 one, one after the other,
    and of one that is float32 within batches and float64 across; and the relative standard error of their mean."""
    exact = float(np.sum(samples, dtype=np.float64))
    if not exact:
        return 0.0, 0.0, 0.0
    # cumsum adds one after the other, where sum would add pairs
    running = float(np.cumsum(samples, dtype=np.float32)[-1])
    whole = len(samples) // batch * batch
    parts = np.cumsum(samples[:whole].reshape(-1, batch), axis=1, dtype=np.float32)[:, -1]
    rest = np.cumsum(samples[whole:], dtype=np.float32)[-1:]
    batched = float(np.sum(parts, dtype=np.float64) + np.sum(rest, dtype=np.float64))
    noise = float(np.std(samples, dtype=np.float64)) / len(samples) ** 0.5 / (exact / len(samples))
    return abs(running / exact - 1), abs(batched / exact - 1), noise


HALF_SHARE = 0.1
"""Share of `render.bias` that rounding to half may take."""

WRITTEN = "zip"


def advise(advice: Advice, rows: Sequence[AccuracyRow], spec: DatasetSpec) -> None:
    """Sentences of both questions, and the type of the files."""
    _storage(advice, rows, spec)
    _sums(advice, rows)


def codec_means(rows: Sequence[AccuracyRow]) -> dict[str, dict[str, float]]:
    """By setting (`float32 zip`), means over examples of bytes, encode and decode seconds."""
    found: dict[str, dict[str, float]] = {}
    whole = [row for row in of(rows, CODECS, WHOLE) if np.isfinite(row.bytes)]
    for setting in dict.fromkeys(row.setting for row in whole):
        own = [row for row in whole if row.setting == setting]
        found[setting] = {name: float(np.mean([getattr(row, name) for row in own]))
                          for name in ("bytes", "encode_seconds", "decode_seconds")}
    return found


def half_errors(rows: Sequence[AccuracyRow]) -> dict[str, float]:
    """By layer, the largest relative error (sqrt of relMSE) that half has in any example."""
    found: dict[str, float] = {}
    for row in of(rows, CODECS):
        if row.setting == "float16" and row.layer != WHOLE:
            found[row.layer] = max(found.get(row.layer, 0.0), row.error)
    return found


def dtype_of(rows: Sequence[AccuracyRow], spec: DatasetSpec) -> str:
    """Half where its error is small enough, the spec's own where nothing was measured."""
    errors = half_errors(rows)
    if not codec_means(rows):
        return spec.storage.dtype
    return "float16" if errors and max(errors.values()) <= HALF_SHARE * spec.render.bias else "float32"


def _storage(advice: Advice, rows: Sequence[AccuracyRow], spec: DatasetSpec) -> None:
    means, errors = codec_means(rows), half_errors(rows)
    if not means:
        return
    dtype = dtype_of(rows, spec)
    smallest = min((setting for setting in means if setting.startswith(dtype)), key=lambda name: means[name]["bytes"])
    shown = ", ".join(_figures(name, means[name]) for name in dict.fromkeys(
        (f"float32 {WRITTEN}", f"float16 {WRITTEN}", smallest)) if name in means)
    worst = f"{max(errors.values()):.1e}" if errors else "unknown"
    advice.sentences[CODECS] = (f"Half is good enough where its error, {worst} at worst, is at most {HALF_SHARE:g} of "
                                f"the bias allowed, {spec.render.bias:g}: {dtype}. Per example: {shown}; `{WRITTEN}` "
                                "is known to every reader, and datasets are written with it.")
    advice.overrides.append(f"storage.dtype={dtype}")


def _figures(name: str, mean: dict[str, float]) -> str:
    return (f"{name} {mean['bytes'] / 1e3:.0f} kB, {mean['encode_seconds'] * 1e3:.0f} ms to write, "
            f"{mean['decode_seconds'] * 1e3:.0f} ms to read")


def drift_means(rows: Sequence[AccuracyRow], setting: str) -> dict[float, float]:
    """By length of the sum, the root mean square over examples of one kind of drift."""
    own = [row for row in of(rows, ACCUMULATION) if row.setting == setting]
    return {count: float(np.sqrt(np.mean([row.drift**2 for row in own if row.value == count])))
            for count in dict.fromkeys(row.value for row in own)}


def _sums(advice: Advice, rows: Sequence[AccuracyRow]) -> None:
    running, batched, noise = (drift_means(rows, setting) for setting in (RUNNING, BATCHED, NOISE))
    if not running:
        return
    most = max(running)
    advice.sentences[ACCUMULATION] = (
        f"After {most:.0g} samples a float32 sum is off by {running[most]:.1e}, one of float32 batches in float64 by "
        f"{batched[most]:.1e}, and the noise of the mean is {noise[most]:.1e}: datasets are rendered the second way.")
