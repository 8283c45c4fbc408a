"""Real spherical harmonics up to degree 2: the light from all directions as a matte surface sees it.

The basis is orthonormal over the sphere, without the Condon-Shortley phase, so that degree 1 is (y, z, x) with a factor
above zero. Order: (l, m) = (0, 0), (1, -1), (1, 0), (1, 1), (2, -2) ... (2, 2). Coefficients of a radiance L are the
integrals of L(w) Y_lm(w) over all w; a Lambertian surface damps them by degree (Ramamoorthi and Hanrahan, "An efficient
representation for irradiance environment maps", SIGGRAPH 2001, equations 3 and 8).
"""

import math
from typing import Any

import numpy as np

COUNT = 9
"""Functions of the basis."""

Y0 = math.sqrt(1 / (4 * math.pi))
Y1 = math.sqrt(3 / (4 * math.pi))
Y2 = math.sqrt(15 / (4 * math.pi))
Y20 = math.sqrt(5 / (16 * math.pi))

COSINE = np.repeat([math.pi, 2 * math.pi / 3, math.pi / 4], [1, 3, 5])
"""(9,) A_l of each function: how the cosine of a Lambertian surface, cut off at 0, damps its degree."""

GOLDEN = (1 + math.sqrt(5)) / 2


def basis(x: Any, y: Any, z: Any) -> tuple[Any, ...]:
    """The 9 functions at unit directions, in order; arrays of NumPy, Dr.Jit or PyTorch of any one shape, or floats."""
    return (Y0 + 0 * x, Y1 * y, Y1 * z, Y1 * x,
            Y2 * x * y, Y2 * y * z, Y20 * (3 * z * z - 1), Y2 * x * z, Y2 / 2 * (x * x - y * y))


def irradiance(lighting: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(..., C) irradiance on surfaces with (..., 3) unit normals, of (9, C) coefficients of radiance.

    A white Lambertian surface sends back the pi-th part of it. What degrees above 2 would add is missing, so that a
    small lamp lights the far side a little, and its neighbourhood by less than nothing.
    """
    functions = np.stack(basis(*np.moveaxis(normals, -1, 0)), axis=-1)
    return (functions * COSINE) @ lighting


def rotation(matrix: np.ndarray) -> np.ndarray:
    """(9, 9) matrix that takes the coefficients of f to those of f(R^-1 w), R an orthogonal (3, 3) matrix, of which
    reflections are some.

    Exact, by quadrature: the 12 corners of an icosahedron integrate every polynomial of degree 5 over the sphere
    (Delsarte, Goethals and Seidel, "Spherical codes and designs", 1977), and products of two functions have degree 4.
    """
    corners = _icosahedron()
    here, turned = (np.stack(basis(*directions.T), axis=-1) for directions in (corners, corners @ matrix))
    return 4 * math.pi / len(corners) * (here.T @ turned)


def _icosahedron() -> np.ndarray:
    """(12, 3) unit corners: (0, +-1, +-golden) and its two cyclic turns."""
    corners = np.array([(0, one, long) for one in (-1, 1) for long in (-GOLDEN, GOLDEN)])
    return np.concatenate([np.roll(corners, turn, axis=1) for turn in range(3)]) / math.hypot(1, GOLDEN)
