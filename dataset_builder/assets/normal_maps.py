"""Texels of normal maps that are no normals: black, which points into the surface, and mid-grey, which is no vector."""

import numpy as np

INWARDS, SHORT = -0.05, 0.2
"""z below which a vector points into the surface, where no light meets it, and length below which it has no direction:
that of 8 bits of grey is 0.007. Vectors along the surface are left alone, and so are means of unlike normals."""


def mended_normals(encoded: np.ndarray, key: str) -> tuple[np.ndarray | None, list[str]]:
    """Encoded normals, (H, W, 3) or more channels in [0, 1], with those straight out that are none; None where none of
    them is one. And what is to be said of that, of the map that `key` names: nothing of a map of normals."""
    depth = 2 * encoded[..., 2] - 1
    if depth.min() >= SHORT:
        return encoded, []
    length = np.sqrt(np.square(2 * encoded[..., :2] - 1).sum(axis=2) + np.square(depth))
    broken = (depth < INWARDS) | (length < SHORT)
    count = int(np.count_nonzero(broken))
    if not count:
        return encoded, []
    if count == broken.size:
        return None, [f"{key}, whose texels all point nowhere or into the surface (black or grey)"]
    mended = encoded.copy()
    mended[broken, :3] = (0.5, 0.5, 1.0)
    return mended, [f"{key} in {count} of {broken.size} texels, which point nowhere or into the surface (black or "
                    "grey): straight out instead"]
