"""Any OpenEXR picture -> colours.

Mitsuba's own reader and writer hand rows to a pool of threads that, in a process which has other libraries' pools too,
may never answer.
"""

from pathlib import Path

import numpy as np
import OpenEXR

COLOURS = (("R", "G", "B"), ("Y", "Y", "Y"))
"""Channels that are taken for colours, the first that are there."""


def read_exr(path: Path) -> np.ndarray:
    """(H, W, 3) float32 as stored; a picture of luminance alone is grey. Raises ValueError for anything else."""
    try:
        file = OpenEXR.File(str(path), separate_channels=True)
        channels = {name: channel.pixels for name, channel in file.channels(0).items()}
    except (RuntimeError, ValueError, TypeError, IndexError, KeyError, MemoryError) as error:
        raise ValueError(f"no OpenEXR picture that can be read ({error})") from error
    for names in COLOURS:
        if set(names) <= set(channels):
            return np.stack([np.asarray(channels[name], dtype=np.float32) for name in names], axis=-1)
    raise ValueError(f"channels {', '.join(sorted(channels))}, none of them R, G, B or Y")
