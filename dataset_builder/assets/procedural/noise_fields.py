"""Fields over one texture tile that repeat without a seam."""

import numpy as np
from scipy.spatial import cKDTree


def grid(size: int) -> tuple[np.ndarray, np.ndarray]:
    """u and v in (0, 1) at the texel centres of a (size, size) image whose row 0 is at v = 1."""
    centres = (np.arange(size) + 0.5) / size
    return np.meshgrid(centres, centres[::-1])


def smooth_noise(rng: np.random.Generator, size: int, *, u_scale: float, v_scale: float) -> np.ndarray:
    """(size, size) noise of mean 0 and deviation 1, blurred by Gaussians of `u_scale` and `v_scale` tiles.

    White noise filtered in the Fourier domain, hence periodic by construction.
    """
    frequencies = np.fft.fftfreq(size) * size
    low_pass = [np.exp(-2 * (np.pi * scale * frequencies) ** 2) for scale in (v_scale, u_scale)]
    spectrum = np.fft.fft2(rng.standard_normal((size, size))) * np.outer(*low_pass)
    spectrum[0, 0] = 0
    field = np.fft.ifft2(spectrum).real
    return field / max(float(field.std()), 1e-12)


def cells(rng: np.random.Generator, size: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Distance to the nearest and to the second of `count` random points on the torus, each (size, size), in tiles."""
    tree = cKDTree(rng.uniform(size=(count, 2)), boxsize=1.0)
    u, v = grid(size)
    distance, _ = tree.query(np.stack([u, v], axis=-1).reshape(-1, 2), k=2)
    return distance[:, 0].reshape(size, size), distance[:, 1].reshape(size, size)


def normals_of(height: np.ndarray, *, relief: float) -> np.ndarray:
    """(H, W, 3) float32 unit normals of a periodic height map (H, W); `relief` is the height of 1 in tiles."""
    size = len(height)
    du = (np.roll(height, -1, axis=1) - np.roll(height, 1, axis=1)) * size / 2
    dv = (np.roll(height, 1, axis=0) - np.roll(height, -1, axis=0)) * size / 2
    normal = np.stack([-relief * du, -relief * dv, np.ones_like(height)], axis=-1)
    return (normal / np.linalg.norm(normal, axis=-1, keepdims=True)).astype(np.float32)


def mix(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    """(H, W, 3) blend of two colours (3,) by `share` (H, W), clipped to [0, 1]."""
    weight = np.clip(share, 0, 1)[..., None]
    return first * (1 - weight) + second * weight


def plausible(colour: np.ndarray) -> np.ndarray:
    """Reflectances within what paints, cloths and woods have (0.03 to 0.85), float32."""
    return np.clip(colour, 0.03, 0.85).astype(np.float32)
