"""Photographs, or renderings, of one object with the cameras that took them: what a field is fitted to."""

from dataclasses import dataclass

import numpy as np

from dataset_builder.errors import UserError


@dataclass(frozen=True, kw_only=True, eq=False)
class PosedImages:
    """N images of one size. Pixel (column 0, row 0) is the upper left one and covers [0, 1) x [0, 1).

    Raises UserError on wrong shapes.
    """

    pixels: np.ndarray
    """(N, H, W, 4) float16 or float32: linear Rec.709 radiance times opacity, then opacity in [0, 1]. It may be mapped
    from a file: whoever reads it takes what is needed at a time."""
    poses: np.ndarray
    """(N, 4, 4) float64 `frame_from_camera`, rigid, metres; a camera looks along its +Z, +X is right, +Y is down."""
    focal: np.ndarray
    """(N, 2) float64 focal lengths along x and y, pixels."""
    centre: np.ndarray
    """(N, 2) float64 principal points x, y, pixels."""
    names: tuple[str, ...] = ()
    """Of each image, for messages; empty for renderings."""

    def __post_init__(self) -> None:
        count = len(self.pixels)
        shapes = {"poses": (count, 4, 4), "focal": (count, 2), "centre": (count, 2)}
        if self.pixels.ndim != 4 or self.pixels.shape[-1] != 4:
            raise UserError(f"posed images: pixels: expected shape (N, H, W, 4), got {self.pixels.shape}")
        for name, expected in shapes.items():
            if (got := getattr(self, name).shape) != expected:
                raise UserError(f"posed images: {name}: expected shape {expected}, got {got}")

    def only(self, chosen: np.ndarray) -> "PosedImages":
        """The images of some indices."""
        return PosedImages(pixels=self.pixels[chosen], poses=self.poses[chosen], focal=self.focal[chosen],
                           centre=self.centre[chosen],
                           names=tuple(self.names[k] for k in np.arange(len(self.pixels))[chosen] if self.names))

    def rays(self, number: int, column: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(P, 3) origins and unit directions, in the frame, through film positions (P,) of one image, pixels."""
        pose, local = self.poses[number], np.stack([column, row], axis=1) - self.centre[number]
        turned = np.column_stack([local / self.focal[number], np.ones(len(local))]) @ pose[:3, :3].T
        return (np.broadcast_to(pose[:3, 3], turned.shape),
                turned / np.linalg.norm(turned, axis=1, keepdims=True))
