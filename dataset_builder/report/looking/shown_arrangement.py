"""An arrangement as it is shown, by a picture and by a page: things, lights, the camera, and what is cut away."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from dataset_builder.geometry.pinhole import Pinhole, look_at
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.scene_plan import IlluminationPlan
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.report.looking.light_shapes import SYMBOL, Illumination, LightShape, SymbolPlaces, light_shapes
from dataset_builder.report.looking.standing import StandingThing, roof_above, standing

AROUND = 3.0
"""Metres about what matters that are shown of a large scene."""
EYE_RISE, EYE_TURN, EYE_FOV = 40.0, 40.0, 35.0
"""Degrees: of the viewer above the horizon, beside the camera, and of what it sees."""
BELOW_ROOF = 0.02
"""Metres below a ceiling where it is cut off."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ShownArrangement:
    """What stands where, for a viewer."""

    things: tuple[StandingThing, ...]
    """The target first."""
    lights: tuple[LightShape, ...]
    """Those of the source, then those of the target; none where no camera was found."""
    camera: Pinhole | None
    """Of the example, if there is one."""
    roof: float
    """Height from which on the building is cut away to look in from above; inf where nothing is above."""

    @property
    def target(self) -> StandingThing:
        """What the example is of."""
        return self.things[0]

    @cached_property
    def centre(self) -> np.ndarray:
        """(3,) middle of the target's box."""
        return np.asarray(self.target.box.mean(axis=0))

    @cached_property
    def bounds(self) -> np.ndarray:
        """(2, 3) corners of what is to be seen: all of a room, what is near of a large scene."""
        return _bounds(self.things, _points(self.target, self.camera, [light.at for light in self.lights
                                                                       if not light.outside]))

    def eye(self, width: int, height: int) -> Pinhole:
        """A viewer above and beside the camera who sees all of `bounds`, and symbols of what shines from outside."""
        low, high = self.bounds
        middle = (low + high) / 2
        back = self.camera.position - self.centre if self.camera else np.array([0.6, -1.0, 0])
        turn = np.arctan2(back[1], back[0]) + np.radians(EYE_TURN)
        rise = np.radians(EYE_RISE)
        toward = np.array([np.cos(turn) * np.cos(rise), np.sin(turn) * np.cos(rise), np.sin(rise)])
        symbols = [light.at for light in self.lights if light.outside]
        seen = np.vstack([np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T, *symbols])
        right, up, forward = look_at(toward, (0, 0, 0)) @ (seen - middle).T
        wide = np.tan(np.radians(EYE_FOV) / 2)
        distance = max((np.abs(right) / wide - forward).max(), (np.abs(up) / (wide * height / width) - forward).max())
        return Pinhole(position=middle + toward * distance * 1.05, target=middle, fov=EYE_FOV, width=width,
                       height=height)


def shown_example(plan: ExamplePlan, mesh_root: Path) -> ShownArrangement:
    """The arrangement of a planned example. Raises UserError where a file is not what was planned."""
    things = standing(plan.room, plan.target, plan.furniture, mesh_root)
    camera = Pinhole.of(plan.camera, plan.render.width, plan.render.height)
    lit: tuple[tuple[Illumination, IlluminationPlan], ...] = (("source", plan.source_light),
                                                              ("target", plan.target_light))
    lamps = [np.array(light.position) for light in plan.target_light.lights if not LIGHT_KINDS[light.kind].outside]
    points = _points(things[0], camera, lamps)
    centre, (low, high) = things[0].box.mean(axis=0), _bounds(things, points)
    # Across the view, so that the symbol of one sky is not in front of the other
    across = camera.basis[0, :2] * 2 * SYMBOL
    lights = tuple(shape for (of, light), side in zip(lit, (-across, across), strict=True)
                   for shape in light_shapes(light, of, SymbolPlaces(centre, low, high, side)))
    return ShownArrangement(things=things, lights=lights, camera=camera, roof=roof_above(things, points))


def shown_room(arrangement: Arrangement, mesh_root: Path) -> ShownArrangement:
    """The arrangement of a pair of which no view can be planned: what stands there, without camera and light."""
    things = standing(arrangement.room, arrangement.target, arrangement.furniture, mesh_root)
    return ShownArrangement(things=things, lights=(), camera=None,
                            roof=roof_above(things, _points(things[0], None, [])))


def _points(target: StandingThing, camera: Pinhole | None, lamps: list[np.ndarray]) -> np.ndarray:
    """(N, 3) what matters: the target, first its middle, the camera, lamps."""
    return np.vstack([target.box.mean(axis=0), target.box, *([camera.position] if camera else []), *lamps])


def _bounds(things: tuple[StandingThing, ...], points: np.ndarray) -> np.ndarray:
    boxes = np.array([thing.box for thing in things])
    return np.stack([np.maximum(boxes[:, 0].min(axis=0), points.min(axis=0) - AROUND),
                     np.minimum(boxes[:, 1].max(axis=0), points.max(axis=0) + AROUND)])
