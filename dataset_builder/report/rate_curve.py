"""Examples by time as a curve of rates, for a page."""

from collections.abc import Sequence

import numpy as np

from dataset_builder.report.console import duration

WIDTH, HEIGHT, MOST = 600, 90, 60
"""Units of the picture, and stretches of time."""


def rate_curve(points: Sequence[tuple[float, int]]) -> dict[str, str]:
    """Outline of the rate over stretches of equal length, as SVG's `points` in the `viewBox` `box`, with what
    its top and its right end mean; empty where too little is known. points: seconds, and examples until then."""
    times, done = np.array(points, dtype=np.float64).T
    count = min(MOST, len(times) // 2)
    if count < 2 or times[-1] <= times[0]:
        return {}
    edges = np.linspace(times[0], times[-1], count + 1)
    rates = np.diff(np.interp(edges, times, done)) / np.diff(edges)
    top = float(rates.max())
    if top <= 0:
        return {}
    across = np.linspace(0, WIDTH, count + 1)
    outline = [(x, HEIGHT * (1 - rate / top)) for begin, end, rate in zip(across, across[1:], rates, strict=False)
               for x in (begin, end)]
    return {"outline": " ".join(f"{x:.1f},{y:.1f}" for x, y in [(0, HEIGHT), *outline, (WIDTH, HEIGHT)]),
            "box": f"0 0 {WIDTH} {HEIGHT}", "top": f"{top * 60:.3g}/min", "end": duration(float(times[-1]))}
