"""tmp"""
from collections.abc import Sequence

from dataset_builder.label.scene_plan import RoomPlan
from dataset_builder.planning.scene.box_shell import BoxShell
from dataset_builder.planning.scene.shell import Geometry, Shell


def shell_of(room: RoomPlan, building: Sequence[Geometry], contents: Sequence[Geometry]) -> Shell:
    return BoxShell(room)
