"""Splats moved, chosen and joined: what they look like goes with them."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from dataset_builder.geometry.splat_cloud import SplatCloud
from dataset_builder.geometry.splat_harmonics import COUNTS, harmonics_turn

CHUNK = 200_000
"""Splats whose axes are decomposed at once."""


def turn_matrices(turns: np.ndarray) -> np.ndarray:
    """(N, 3, 3) float64 rotations of (N, 4) unit quaternions w, x, y, z."""
    return Rotation.from_quat(np.roll(turns, -1, axis=1)).as_matrix()


def turn_quaternions(matrices: np.ndarray) -> np.ndarray:
    """(N, 4) unit quaternions w, x, y, z, w at least 0, of (N, 3, 3) rotations."""
    return np.roll(Rotation.from_matrix(matrices).as_quat(canonical=True), 1, axis=1)


def chosen(cloud: SplatCloud, keep: np.ndarray) -> SplatCloud:
    """The splats that (N,) booleans or some indices say."""
    return replace(cloud, centres=cloud.centres[keep], scales=cloud.scales[keep], turns=cloud.turns[keep],
                   opacities=cloud.opacities[keep], harmonics=cloud.harmonics[keep])


def moved(cloud: SplatCloud, matrix: np.ndarray) -> SplatCloud:
    """The splats moved by a (4, 4) affine matrix that has an inverse.

    Covariances become M C M^T, exactly; what they look like from a direction is turned by the orthogonal matrix nearest
    to M, as KHR_gaussian_splatting has it, so that shear leaves view dependence a little off.
    """
    linear = matrix[:3, :3]
    left, stretch, right = np.linalg.svd(linear)
    nearest = left @ right
    if np.allclose(stretch, stretch.mean(), rtol=1e-6, atol=0):
        # An ellipsoid is its own mirror image: minus an improper matrix turns it as well
        axes = nearest * np.sign(np.linalg.det(nearest)) @ turn_matrices(cloud.turns)
        turns, scales = turn_quaternions(axes), cloud.scales * stretch.mean()
    else:
        parts = [_stretched(linear, cloud, slice(first, first + CHUNK)) for first in range(0, len(cloud), CHUNK)]
        turns, scales = (np.concatenate(each) for each in zip(*parts, strict=True))
    count = cloud.harmonics.shape[1]
    harmonics = cloud.harmonics
    if not np.allclose(nearest, np.eye(3), atol=1e-12):
        wigner = harmonics_turn(nearest)[:count, :count].astype(np.float32)
        harmonics = np.einsum("jk,nkc->njc", wigner, harmonics)
    centres = cloud.centres.astype(np.float64) @ linear.T + matrix[:3, 3]
    return replace(cloud, centres=centres.astype(np.float32), scales=scales.astype(np.float32),
                   turns=turns.astype(np.float32), harmonics=harmonics)


def _stretched(linear: np.ndarray, cloud: SplatCloud, part: slice) -> tuple[np.ndarray, np.ndarray]:
    """Quaternions and scales of what a matrix makes of some splats."""
    axes, scales, _ = np.linalg.svd(linear @ (turn_matrices(cloud.turns[part]) * cloud.scales[part, None, :]))
    return turn_quaternions(axes * np.sign(np.linalg.det(axes))[:, None, None]), scales


def joined(clouds: list[SplatCloud]) -> SplatCloud:
    """One cloud of several with colours of one encoding; the degree is the highest of any."""
    count = max(cloud.harmonics.shape[1] for cloud in clouds)
    assert count in COUNTS and len({cloud.srgb for cloud in clouds}) == 1
    padded = [np.pad(each.harmonics, ((0, 0), (0, count - each.harmonics.shape[1]), (0, 0))) for each in clouds]
    return SplatCloud(harmonics=np.concatenate(padded), srgb=clouds[0].srgb, **{
        name: np.concatenate([getattr(each, name) for each in clouds])
        for name in ("centres", "scales", "turns", "opacities")})
