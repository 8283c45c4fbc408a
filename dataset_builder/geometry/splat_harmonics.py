"""Spherical harmonics as Gaussian splats have them: real, up to degree 3, with the Condon-Shortley phase.

Kerbl and others, "3D Gaussian Splatting for Real-Time Radiance Field Rendering", SIGGRAPH 2023; the functions are those
of appendix A of glTF's KHR_gaussian_splatting. Order: (l, m) = (0, 0), (1, -1), (1, 0), (1, 1), (2, -2) ... (3, 3).
Unlike `geometry.harmonics`, odd m have another sign.
"""

import math

import numpy as np

COUNTS = (1, 4, 9, 16)
"""Functions up to each degree."""
Y0 = math.sqrt(1 / (4 * math.pi))
Y1 = math.sqrt(3 / (4 * math.pi))
Y2 = tuple(math.sqrt(k / math.pi) for k in (15 / 4, 5 / 16, 15 / 16))
Y3 = tuple(math.sqrt(k / math.pi) for k in (35 / 32, 105 / 4, 21 / 32, 7 / 16, 105 / 16))


def splat_basis(directions: np.ndarray, count: int) -> np.ndarray:
    """(..., count) values of the first `count` functions, one of `COUNTS`, in (..., 3) unit directions."""
    x, y, z = np.moveaxis(directions, -1, 0)
    xx, yy, zz = x * x, y * y, z * z
    found = (Y0 + 0 * x, -Y1 * y, Y1 * z, -Y1 * x,
             Y2[0] * x * y, -Y2[0] * y * z, Y2[1] * (2 * zz - xx - yy), -Y2[0] * x * z, Y2[2] * (xx - yy),
             -Y3[0] * y * (3 * xx - yy), Y3[1] * x * y * z, -Y3[2] * y * (4 * zz - xx - yy),
             Y3[3] * z * (2 * zz - 3 * xx - 3 * yy), -Y3[2] * x * (4 * zz - xx - yy), Y3[4] * z * (xx - yy),
             -Y3[0] * x * (xx - 3 * yy))
    return np.stack(found[:count], axis=-1)


def harmonics_turn(matrix: np.ndarray) -> np.ndarray:
    """(16, 16) matrix that takes the coefficients of f to those of f(R^-1 w), R an orthogonal (3, 3) matrix, of which
    reflections are some: Wigner's matrices of degrees 0 to 3 along its diagonal.

    Exact, by quadrature: four heights of Gauss and Legendre times eight azimuths integrate every polynomial of degree 7
    over the sphere, and products of two functions have degree 6.
    """
    heights, weights = np.polynomial.legendre.leggauss(4)
    azimuth = np.arange(8) * (math.pi / 4)
    across = np.sqrt(1 - heights**2)[:, None]
    directions = np.stack([across * np.cos(azimuth), across * np.sin(azimuth),
                           np.broadcast_to(heights[:, None], (4, 8))], axis=-1).reshape(-1, 3)
    here, turned = splat_basis(directions, 16), splat_basis(directions @ matrix, 16)
    made = here.T @ (np.repeat(weights * (math.pi / 4), 8)[:, None] * turned)
    degree = np.repeat(np.arange(4), (1, 3, 5, 7))
    return np.where(degree[:, None] == degree, made, 0.0)
