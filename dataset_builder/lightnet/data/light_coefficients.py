"""The light that arrives at an object, as nine numbers per channel, in the camera's frame."""

import numpy as np

from dataset_builder.errors import Problem, UserError
from dataset_builder.geometry.harmonics import rotation
from dataset_builder.geometry.pinhole import look_at
from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.label.scene_plan import CameraPlan

MIRROR = np.sign(np.diag(rotation(np.diag([-1.0, 1.0, 1.0]))))
"""(9,) factors that take the coefficients of a light to those of its mirror image, left for right."""


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
