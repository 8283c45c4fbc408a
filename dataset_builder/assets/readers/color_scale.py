"""Colours of vertices as decimal numbers -> shares: formats do not say whether they end at 1 or at 255."""

import numpy as np

MOST_SHARE = 16.0
"""Above this, no program means a share."""


def as_shares(values: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Values of colours as shares in [0, 1], NaN kept, and what is doubtful of them, in words.

    Whole numbers above 1 and anything above `MOST_SHARE` count up to 255. All else is a share; interpolated and
    emissive colours go beyond 1, and a single one of them must not make the others black.
    """
    finite = values[np.isfinite(values)]
    highest = finite.max(initial=0)
    if highest > MOST_SHARE or (highest > 1 and (finite == np.round(finite)).all()):
        return np.clip(values / 255, 0, 1), ["vertex colours above 1 read as counted up to 255"]
    beyond = int(((values < 0) | (values > 1)).sum())
    return np.clip(values, 0, 1), [f"{beyond:,} values of vertex colours beyond 0 to 1, clipped"] if beyond else []
