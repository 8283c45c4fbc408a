"""The arrangement of one pair: room, target and furniture in place, and the rays that planning casts at them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dataset_builder.geometry.raycast import RayScene
from dataset_builder.label.scene_plan import PlacedObject, RoomPlan

TARGET_INSTANCE = 1
ROOM_INSTANCE = 2
FURNITURE_INSTANCE = 3
"""Value in the `instance` layer of the first piece of furniture."""
Geometry = tuple[np.ndarray, np.ndarray, int]
"""World positions (V, 3), faces (F, 3), instance."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Arrangement:
    """Everything of a pair that cameras and lights are planned against.

    centre (3,), radius: of the sphere about the target's box, in the room, metres. `everything` holds all geometry,
    `alone` the target only. notes: what layout had to leave out.
    """

    room: RoomPlan
    target: PlacedObject
    furniture: tuple[PlacedObject, ...]
    geometry: tuple[Geometry, ...]
    notes: tuple[str, ...] = ()

    @cached_property
    def everything(self) -> RayScene:
        """Target, room and furniture."""
        return RayScene(list(self.geometry))

    @cached_property
    def alone(self) -> RayScene:
        """The target without anything else."""
        return RayScene([part for part in self.geometry if part[2] == TARGET_INSTANCE])

    @cached_property
    def _target_box(self) -> np.ndarray:
        own = [part for part in self.geometry if part[2] == TARGET_INSTANCE]
        corners = np.concatenate([positions[np.unique(faces)] for positions, faces, _ in own])
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    @property
    def centre(self) -> np.ndarray:
        """(3,) middle of the target's box."""
        return self._target_box.mean(axis=0)

    @property
    def radius(self) -> float:
        """Half the diagonal of the target's box."""
        return float(np.linalg.norm(np.diff(self._target_box, axis=0)) / 2)

    @property
    def room_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) low and (3,) high corner of the room."""
        half = np.array([self.room.width, self.room.depth]) / 2
        return np.array([*-half, 0.0]), np.array([*half, self.room.height])
