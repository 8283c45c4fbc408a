"""Turns that stand things up."""

import numpy as np

from dataset_builder.errors import UserError


def upright(up: tuple[float, float, float], yaw: float) -> np.ndarray:
    """(4, 4) rotation that turns `up` to +Z the shortest way, Y up about X, and then by `yaw` degrees about Z. Raises
    UserError for an `up` of no length."""
    length = float(np.linalg.norm(up))
    if not 0 < length < np.inf:
        raise UserError(f"up: expected a direction, got {list(up)}")
    axis = np.array(up) / length
    # The turn about a x z by the angle between them; half a turn about X where they are opposite
    cross, cosine = np.cross(axis, [0, 0, 1.0]), axis[2]
    skew = np.array([[0, -cross[2], cross[1]], [cross[2], 0, -cross[0]], [-cross[1], cross[0], 0]])
    turn = np.diag([1.0, -1.0, -1.0]) if cosine < -1 + 1e-12 else np.eye(3) + skew + skew @ skew / (1 + cosine)
    angle = np.radians(yaw)
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]) @ turn
    return matrix
