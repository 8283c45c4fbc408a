"""Cameras that a scene's author placed: those that see the target as the dataset asks."""

from collections.abc import Sequence

import numpy as np

from dataset_builder.assets.scene_model import SceneCamera
from dataset_builder.errors import PlanError, Problem
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.scene_plan import CameraPlan
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.cameras import PlannedCamera, judged
from dataset_builder.planning.view.visibility import Sight, look
from dataset_builder.spec.camera import CameraSpec
from dataset_builder.spec.render import ImageSpec

TOLD = 8
"""Cameras that a message names."""


def own_camera(arrangement: Arrangement, cameras: Sequence[SceneCamera], spec: CameraSpec, image: ImageSpec,
               number: int, where: str) -> PlannedCamera:
    """Camera `number`, from 0, of those of a scene that see the target as `spec` asks, in the order of the file.

    Coverage and visibility are asked for; angles and the clearance are the author's. The horizontal field of view is
    kept, whatever the aspect of the image. Raises PlanError, naming `where`, with what each camera sees where there are
    too few.
    """
    seen, found = list[tuple[str, Sight]](), 0
    for camera in cameras:
        frame = _frame(camera, image)
        sight = look(arrangement, frame)
        if judged(spec, sight) is None:
            if found == number:
                return _planned(camera, sight, found)
            found += 1
        seen.append((camera.name, sight))
    raise PlanError([_too_few(seen, spec, number, found, where)])


def _frame(camera: SceneCamera, image: ImageSpec) -> Pinhole:
    return Pinhole(position=np.array(camera.position), target=np.array(camera.target), up=np.array(camera.up),
                   fov=camera.fov, width=image.width, height=image.height)


def _planned(camera: SceneCamera, sight: Sight, number: int) -> PlannedCamera:
    plan = CameraPlan(position=camera.position, target=camera.target, up=camera.up, fov=camera.fov,
                      coverage=sight.coverage, visibility=sight.visibility)
    return PlannedCamera(camera=plan, sight=sight, note=f"camera: {camera.name} of the scene, number {number + 1} of "
                         f"those that see the object; coverage {sight.coverage:.3f}, visibility {sight.visibility:.2f}")


def _too_few(seen: Sequence[tuple[str, Sight]], spec: CameraSpec, number: int, found: int, where: str) -> Problem:
    best = sorted(seen, key=lambda each: -each[1].coverage)
    each = "; ".join(f"{name}: coverage {sight.coverage:.3f}, visibility {sight.visibility:.2f}"
                     for name, sight in best[:TOLD])
    more = f"; {len(best) - TOLD} more that see less" if len(best) > TOLD else ""
    (low, high), many = spec.coverage, f"at least {number + 1} cameras of the scene that see" if number else \
        "a camera of the scene that sees"
    rule = (f"expected {many} the object on {low:g} to {high:g} of the frame with visibility >= {spec.visibility:g}, "
            f"got {found or 'none'} of {len(seen)}" + (f": {each}{more}" if seen else ""))
    return Problem(where=where, path="camera", rule=rule,
                   hint="widen `camera.coverage`, lower `camera.visibility`, ask for fewer `views`, choose another "
                        "object, or write `cameras: random` in the scene spec")
