"""Colours of other primaries and white points -> linear Rec.709."""

import numpy as np

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""x and y of red, green, blue and white (ITU-R BT.709-6)."""
BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
"""CIE XYZ to the cone responses of the Bradford transform (ICC.1:2022, annex E)."""
SAME = 1e-4
"""Difference of coordinates below which primaries are those of Rec.709."""


def xyz_from_rgb(chromaticities: tuple[float, ...]) -> np.ndarray:
    """(3, 3) matrix to CIE XYZ, Y of white being 1 (SMPTE RP 177); its middle row weighs luminance.

    chromaticities: x and y of red, green, blue and white. Raises ValueError where they span no colours.
    """
    points = np.array(chromaticities, dtype=np.float64).reshape(4, 2)
    colours = np.concatenate([points, 1 - points.sum(axis=1, keepdims=True)], axis=1)
    bounded = bool((np.abs(points) < 10).all()) and points[3, 1] > 1e-3
    if not bounded or abs(np.linalg.det(colours[:3])) < 1e-6 or (BRADFORD @ colours[3] <= 0).any():
        raise ValueError(f"chromaticities {', '.join(f'{value:g}' for value in chromaticities)}, which span no colours")
    primaries = colours[:3].T
    return primaries * np.linalg.solve(primaries, colours[3] / points[3, 1])


def rec709_from_rgb(chromaticities: tuple[float, ...]) -> np.ndarray | None:
    """(3, 3) matrix from linear colours of these chromaticities, white to white by the Bradford transform; None where
    they are those of Rec.709. Raises ValueError as `xyz_from_rgb` does."""
    matrix = xyz_from_rgb(chromaticities)
    if np.allclose(chromaticities, REC709, rtol=0, atol=SAME):
        return None
    ours = xyz_from_rgb(REC709)
    cones = BRADFORD @ ours.sum(axis=1) / (BRADFORD @ matrix.sum(axis=1))
    return np.linalg.inv(ours) @ np.linalg.inv(BRADFORD) @ np.diag(cones) @ BRADFORD @ matrix
