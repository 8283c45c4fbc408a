"""From layers on disk to the tensors of a batch: cropped, mirrored, exposed, 0 outside the object.

The pictures of a batch share one stretch of memory, which may be one that two processes share.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import torch

from dataset_builder.errors import Problem, UserError
from dataset_builder.geometry.harmonics import rotation
from dataset_builder.geometry.pinhole import look_at
from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.label.scene_plan import CameraPlan
from dataset_builder.lightnet.data.augment import STILL, Variation, Window
from dataset_builder.lightnet.data.batch import Batch, Inputs, Truth

MIRROR = np.sign(np.diag(rotation(np.diag([-1.0, 1.0, 1.0]))))
"""(9,) factors that take the coefficients of a light to those of its mirror image, left for right."""
CHANNELS = {"i_s": 3, "d": 3, "r": 3, "i_t": 3, "s_prime": 3, "inside": 1}
EXTRA = ("i_t_se", "i_t_half")
"""Layers of three channels that tell the noise of I_t, for who asks for them."""


def camera_from_world(camera: CameraPlan) -> np.ndarray:
    """(3, 3) rotation of a label's camera: rows are x (right), y (up) and z (to the viewer) in the world."""
    right, up, forward = look_at(camera.position, camera.target, camera.up)
    return np.stack([right, up, -forward])


def lighting_of(label: ExampleLabel) -> np.ndarray:
    """(3, 9) coefficients of the radiance that arrives, R, G, B by `geometry.harmonics`, in the camera's frame.

    Raises UserError where the label has none, which datasets built by earlier versions have not.
    """
    if not label.record.lighting_sh:
        raise UserError([Problem(where=f"example {label.key}", path="record.lighting_sh", hint="build it again",
                                 rule="expected the light at the object, got none: the dataset was built by an "
                                      "earlier version")])
    return (rotation(camera_from_world(label.plan.camera)) @ np.asarray(label.record.lighting_sh)).T


@dataclass(frozen=True, kw_only=True, eq=False)
class ExamplePart:
    """One example, not varied."""

    key: str
    layers: Iterable[tuple[str, np.ndarray]]
    """(3, H, W) in all colours with their names, perhaps read as they are asked for, and once."""
    inside: np.ndarray
    """(H, W) bool."""
    exposure: float
    """Of the target light."""
    source_exposure: float
    """Of the source light."""
    lighting: np.ndarray
    """(3, 9), not exposed, in the camera's frame."""
    extra: tuple[str, ...] = ()
    """Layers beyond those of every example, among `EXTRA`."""


Chosen = tuple[ExamplePart, Variation, Window]
"""An example, its augmentation, and its crop."""


@dataclass(frozen=True, kw_only=True)
class Shape:
    """Of a batch: examples, rows, columns, and layers among `EXTRA`."""

    count: int
    height: int
    width: int
    extra: tuple[str, ...] = ()

    @property
    def channels(self) -> dict[str, int]:
        """Of every picture by name."""
        return CHANNELS | dict.fromkeys(self.extra, 3)

    @property
    def numbers(self) -> int:
        """Of all pictures together."""
        return sum(self.channels.values()) * self.count * self.height * self.width

    def pictures(self, memory: torch.Tensor) -> dict[str, torch.Tensor]:
        """(B, C, H, W) pictures by name in (numbers,) memory, one after the other."""
        sizes = [channels * self.count * self.height * self.width for channels in self.channels.values()]
        return {name: part.view(self.count, channels, self.height, self.width)
                for (name, channels), part in zip(self.channels.items(), memory.split(sizes), strict=True)}


@dataclass(frozen=True, kw_only=True, eq=False)
class Notes:
    """What belongs to a batch beside pictures."""

    keys: tuple[str, ...]
    exposure: np.ndarray
    """(B,) float32."""
    sh: np.ndarray
    """(B, 3, 9) float32."""


def whole(part: ExamplePart) -> Batch:
    """A batch of one example, its whole frame, not varied."""
    height, width = part.inside.shape
    return assemble([(part, STILL, Window(top=0, left=0, height=height, width=width))],
                    Shape(count=1, height=height, width=width, extra=part.extra))


def assemble(chosen: Iterable[Chosen], shape: Shape) -> Batch:
    """The batch of some examples; windows are as large as the shape says."""
    memory = torch.empty(shape.numbers)
    return batch_of(memory, fill(memory, chosen, shape), shape)


def fill(memory: torch.Tensor, chosen: Iterable[Chosen], shape: Shape) -> Notes:
    """Write the pictures of a batch into (numbers,) float32 memory; the rest is returned.

    Examples and their layers are taken one after the other, each while it is still in the processor's cache. No work is
    shared out to threads, which would wait for those of the training.
    """
    pictures = {name: picture.numpy() for name, picture in shape.pictures(memory).items()}
    notes = []
    for number, (part, variation, window) in enumerate(chosen):
        lit = np.multiply(variation.gain, part.exposure)[:, None, None]
        covered = _cut(part.inside, window, variation.mirrored).astype(np.float32)[None]
        _write(pictures["inside"][number], covered, covered)
        exposed = covered * lit.astype(np.float32)
        weights = {"i_s": covered * np.float32(part.source_exposure), "i_t": exposed, "s_prime": exposed,
                   **dict.fromkeys(EXTRA, exposed)}
        for name, planes in part.layers:
            _write(pictures[name][number], _cut(planes, window, variation.mirrored), weights.get(name, covered))
        sh = part.lighting * lit[:, :, 0]
        notes.append((part.key, part.exposure, sh * MIRROR if variation.mirrored else sh))
    keys, exposures, lights = zip(*notes, strict=True)
    return Notes(keys=keys, exposure=np.array(exposures, np.float32), sh=np.array(lights, np.float32))


def batch_of(memory: torch.Tensor, notes: Notes, shape: Shape) -> Batch:
    """A batch in the memory that holds its pictures."""
    pictures = shape.pictures(memory)
    return Batch(
        keys=notes.keys, exposure=torch.from_numpy(notes.exposure),
        inputs=Inputs(**{name: pictures[name] for name in ("i_s", "s_prime", "inside")}, sh=torch.from_numpy(notes.sh)),
        truth=Truth(**{name: pictures[name] for name in ("i_t", "d", "r", *shape.extra)}),
    )


def planes_of(picture: np.ndarray) -> np.ndarray:
    """(3, H, W) of an (H, W, 3) picture; a view."""
    return np.moveaxis(picture, -1, 0)


def _cut(planes: np.ndarray, window: Window, mirrored: bool) -> np.ndarray:
    """The part of (..., H, W) in a window, as far as the picture goes."""
    top, left, height, width = window
    stretch = planes[..., top:top + height, left:left + width]
    return stretch[..., ::-1] if mirrored else stretch


def _write(target: np.ndarray, planes: np.ndarray, weight: np.ndarray) -> None:
    """Planes times weight into the upper left of (C, H, W), which is 0 elsewhere."""
    rows, columns = planes.shape[1:]
    if planes.shape != target.shape:
        target[:] = 0
    np.multiply(planes, weight, out=target[:, :rows, :columns])
