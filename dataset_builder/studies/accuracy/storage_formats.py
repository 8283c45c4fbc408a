"""Question 7: bytes, time and error of each type and each lossless codec, on whole examples as the dataset has them."""

import math
from collections.abc import Callable, Iterator
from time import perf_counter
from typing import TypeVar

import numpy as np

from dataset_builder.errors import ShardError
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.shards import exr
from dataset_builder.studies.accuracy.rows import WHOLE, AccuracyRow
from dataset_builder.studies.accuracy.workbench import PLAIN, Bench
from dataset_builder.studies.image_errors import relative_mse
from dataset_builder.studies.timing import render

CODECS = "codecs"
Result = TypeVar("Result")


def measure(bench: Bench, ref: ExampleRef) -> Iterator[AccuracyRow]:
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
            yield _row(kept, codec, dtype, plan.key, bench.budget.codec_repeats)
        for name, image in layers.items():
            everywhere = np.ones(image.shape[:2], dtype=bool)
            lost = relative_mse(kept[name], image, everywhere)
            yield AccuracyRow(question=CODECS, setting=dtype, value=math.nan, example=plan.key, layer=name, relmse=lost,
                              relmse_measured=lost, relmse_reference=0.0, floor=0.0)


def _row(kept: dict[str, np.ndarray], codec: str, dtype: exr.DType, key: str, repeats: int) -> AccuracyRow:
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
