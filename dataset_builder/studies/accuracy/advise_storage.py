"""Questions 7 and 8: type and codec of the files, and whether sums drift."""

from collections.abc import Sequence

import numpy as np

from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.studies.accuracy.accumulation import ACCUMULATION, BATCHED, NOISE, RUNNING
from dataset_builder.studies.accuracy.advice import Advice
from dataset_builder.studies.accuracy.rows import WHOLE, AccuracyRow, of
from dataset_builder.studies.accuracy.storage_formats import CODECS

HALF_SHARE = 0.1
"""Share of `render.bias` that rounding to half may take."""

WRITTEN = "zip"


def advise(advice: Advice, rows: Sequence[AccuracyRow], spec: DatasetSpec) -> None:
    """Sentences of both questions, and the type of the files."""
    _storage(advice, rows, spec)
    _accumulation(advice, rows)


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


def _storage(advice: Advice, rows: Sequence[AccuracyRow], spec: DatasetSpec) -> None:
    means, errors = codec_means(rows), half_errors(rows)
    if not means:
        return
    dtype = "float16" if errors and max(errors.values()) <= HALF_SHARE * spec.render.bias else "float32"
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


def _accumulation(advice: Advice, rows: Sequence[AccuracyRow]) -> None:
    running, batched, noise = (drift_means(rows, setting) for setting in (RUNNING, BATCHED, NOISE))
    if not running:
        return
    most = max(running)
    advice.sentences[ACCUMULATION] = (
        f"After {most:.0g} samples a float32 sum is off by {running[most]:.1e}, one of float32 batches in float64 by "
        f"{batched[most]:.1e}, and the noise of the mean is {noise[most]:.1e}: datasets are rendered the second way.")
