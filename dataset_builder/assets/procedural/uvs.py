"""Texture coordinates in metres: box projection along the nearest axis, with the grain along v."""

import numpy as np


def box_uvs(corners: np.ndarray, axis: np.ndarray, sign: np.ndarray, *, grain: int) -> np.ndarray:
    """(F, 3, 2) coordinates in metres of `corners` (F, 3, 3), seen along `axis` (F,) from its side `sign` (F,).

    v runs along axis `grain` (0 x, 1 y, 2 z) wherever the face holds it, and (u, v, outward) is right-handed.
    """
    uvs = np.empty((*corners.shape[:2], 2))
    for normal in range(3):
        chosen = axis == normal
        v_axis = grain if grain != normal else (1 if normal == 2 else 2)
        u_axis = 3 - normal - v_axis
        handed = 1 if (u_axis, v_axis) in ((0, 1), (1, 2), (2, 0)) else -1
        uvs[chosen, :, 0] = corners[chosen, :, u_axis] * (handed * sign[chosen])[:, None]
        uvs[chosen, :, 1] = corners[chosen, :, v_axis]
    return uvs


def facing(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(F,) nearest axis and (F,) sign of every face's normal; ties go to the first axis, whatever the rounding."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    units = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0).round(6)
    axis = np.abs(units).argmax(axis=1)
    sign = np.where(np.take_along_axis(units, axis[:, None], axis=1)[:, 0] < 0, -1.0, 1.0)
    return axis, sign
