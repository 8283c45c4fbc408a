"""What a capture is, whatever wrote it: photographs with the cameras that took them."""

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from dataset_builder.errors import Problem, UserError

STEPS = 20
"""Of the iteration that undoes a lens; each gains about a digit for the lenses of photographs."""


@dataclass(frozen=True, kw_only=True)
class Lens:
    """How directions become pixels: OpenCV's pinhole with two radial and two tangential terms. Pixel (column 0, row 0)
    is the upper left one and covers [0, 1) x [0, 1)."""

    size: tuple[int, int]
    """Width and height of the image, pixels; (0, 0) where nothing says them."""
    focal: tuple[float, float]
    """Along x and y, pixels."""
    centre: tuple[float, float]
    """Principal point x, y, pixels."""
    bend: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """k1, k2, p1, p2."""
    angle: float = 0.0
    """Horizontal field of view in radians where the file says it; 0 where it does not."""

    def scaled(self, size: tuple[int, int]) -> "Lens":
        """The same lens for its image scaled to `size`."""
        x, y = size[0] / self.size[0], size[1] / self.size[1]
        return replace(self, size=size, focal=(self.focal[0] * x, self.focal[1] * y),
                       centre=(self.centre[0] * x, self.centre[1] * y))

    def pixels(self, ways: np.ndarray) -> np.ndarray:
        """(..., 2) pixels of (..., 2) directions x / z, y / z."""
        return self._bent(ways) * self.focal + self.centre

    def ways(self, pixels: np.ndarray) -> np.ndarray:
        """(..., 2) directions x / z, y / z of (..., 2) pixels: `pixels` undone, by a fixed point."""
        bent = (pixels - np.array(self.centre)) / self.focal
        ways = bent
        for _ in range(STEPS if any(self.bend) else 0):
            ways = np.clip(ways + bent - self._bent(ways), -10, 10)
        return ways

    def _bent(self, ways: np.ndarray) -> np.ndarray:
        """OpenCV, Camera Calibration and 3D Reconstruction, "Detailed Description"."""
        if not any(self.bend):
            return ways
        k1, k2, p1, p2 = self.bend
        x, y = ways[..., 0], ways[..., 1]
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * k2)
        return np.stack([x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                         y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y], axis=-1)


@dataclass(frozen=True, kw_only=True, eq=False)
class CaptureShot:
    """A photograph."""

    name: str
    """As its capture calls it."""
    image: Path
    mask: Path | None
    """White is the object; None where the image's own alpha is to be taken, if it has any."""
    lens: Lens
    pose: np.ndarray
    """(4, 4) float64 `frame_from_camera`; a camera looks along its +Z, +X is right, +Y is down."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Capture:
    """Photographs of one thing."""

    layout: str
    """Who writes captures like this one: `COLMAP`, `transforms.json`, `ActorsHQ`."""
    shots: tuple[CaptureShot, ...]
    metric: bool = False
    """Whether lengths are metres."""
    points: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    """Points that were found on surfaces, by their numbers."""

    def only(self, chosen: Iterable[int]) -> "Capture":
        """The shots of some indices."""
        return replace(self, shots=tuple(self.shots[index] for index in chosen))


def listed(names: Iterable[str], most: int = 4) -> str:
    """Some names for a message, and how many more there are.

    >>> listed(["a", "b", "c"], most=2)
    'a, b and 1 more'
    """
    names = list(names)
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def problem(where: Path | str, rule: str, hint: str = "", path: str = "") -> UserError:
    """A UserError with one problem."""
    return UserError([Problem(where=str(where), path=path, rule=rule, hint=hint)])


def find_mask(image: Path, images: Path, masks: Path) -> Path | None:
    """The mask of an image below `images`: below `masks` the same name, the same stem as PNG, or COLMAP's `NAME.png`;
    the second, where none is there. None where there is no folder `masks`."""
    if not masks.is_dir():
        return None
    own = masks / (image.relative_to(images) if image.is_relative_to(images) else image.name)
    choices = (own.with_suffix(".png"), own, own.with_name(f"{own.name}.png"))
    return next((choice for choice in choices if choice.is_file()), choices[0])


def inside(folder: Path, name: str, where: str) -> Path:
    """A file that a capture names. Raises UserError for a path that leads out of its folder."""
    if "\\" in name and not (folder / name).exists():
        # As Windows writes paths
        name = name.replace("\\", "/")
    path = folder / name
    if "\0" in name or Path(name).is_absolute() or ".." in Path(name).parts:
        raise problem(where, f"expected the path of a file in {folder.name}, got {json.dumps(name)[:80]}",
                      "give the capture's own files relative to its folder")
    return path


def rigid(turn: np.ndarray, place: np.ndarray) -> np.ndarray:
    """(4, 4) of a (3, 3) rotation and a (3,) translation."""
    return np.vstack([np.column_stack([turn, place]), [0.0, 0.0, 0.0, 1.0]])


def guarded(path: Path, what: str, read: Callable[[], Capture]) -> Capture:
    """What `read` gives. Raises UserError where the file is damaged in whatever way."""
    try:
        return read()
    except UserError:
        raise
    except (OSError, ValueError, KeyError, TypeError, IndexError, OverflowError, ArithmeticError, RecursionError,
            MemoryError) as error:
        raise problem(path, f"expected {what}, got something else ({error})", "copy it again, whole") from error
