"""Random viewpoints from which the object is visible: in the room, clear of surfaces, at the requested coverage."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import radians, sqrt, tan

import numpy as np

from dataset_builder.errors import PlanError, Problem
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.scene_plan import CameraPlan, Vector
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.camera_misses import Cause, Miss, explained, noted
from dataset_builder.planning.view.visibility import Sight, look, silhouette_area
from dataset_builder.spec.camera import CameraSpec
from dataset_builder.spec.numbers import draw
from dataset_builder.spec.render import ImageSpec

AIM_JITTER = 0.1
"""Largest offset of the aimed point from the object's centre along each axis, in bounding-sphere radii."""
MIN_COVERAGE = 1e-3
"""What a drawn coverage of 0 is taken as, to have a finite distance."""
DIRECTIONS = 8
"""Directions per draw that are looked along for depth of room, which costs little."""
NARROW, FEW = 10.0, 3
"""Degrees about their mean that views are told to be alike within, and views that this takes at least."""
CLEARANCE, CLEAR_RADII = 0.15, 0.5
"""Metres between the camera and any surface, and the same in bounding radii of the object; the lesser unless a spec
says otherwise, so that a ring can be as large in the frame as a chair."""


@dataclass(frozen=True, kw_only=True)
class PlannedCamera:
    """A camera, what it sees of the target, and how it was found."""

    camera: CameraPlan
    sight: Sight
    note: str


@dataclass(frozen=True, kw_only=True, eq=False)
class _Draw:
    """One drawn camera before its distance is known."""

    direction: np.ndarray
    """(3,) leads from the object's centre to the camera."""
    aim: np.ndarray
    fov: float
    image: ImageSpec
    area: float
    """Of the object's silhouette from far along `direction`, square metres."""
    wanted: float
    """Coverage."""

    @property
    def distance(self) -> float:
        """Where the silhouette covers as much of the frame as wanted, perspective aside."""
        return distance_for(self.area, self.wanted, self.fov, self.image)


def distance_for(area: float, coverage: float, fov: float, image: ImageSpec) -> float:
    """Metres at which a silhouette of `area` square metres has that share of the frame, perspective aside."""
    return sqrt(area / (coverage * 4 * tan(radians(fov) / 2) ** 2 * (image.height / image.width)))


def towards(azimuth: float, elevation: float) -> np.ndarray:
    """(3,) unit vector at `elevation` degrees above the horizon; azimuth 0 is -Y, 90 is +X."""
    a, e = radians(azimuth), radians(elevation)
    return np.array([np.sin(a) * np.cos(e), -np.cos(a) * np.cos(e), np.sin(e)])


def vector(array: np.ndarray) -> Vector:
    """Three floats of an array (3,)."""
    x, y, z = (float(value) for value in array)
    return x, y, z


def inside(arrangement: Arrangement, point: np.ndarray, margin: float) -> bool:
    """Whether a camera or a lamp may be at a point, `margin` metres from what bounds the space about the target, and
    from where the target turns through."""
    return arrangement.shell.inside(point, margin, arrangement.centre) and not arrangement.sweeps(point, margin)


def clearance_of(arrangement: Arrangement, spec: CameraSpec) -> float:
    """Least distance of a camera from any surface, metres."""
    return min(CLEARANCE, CLEAR_RADII * arrangement.radius) if spec.clearance == "auto" else spec.clearance


def _draw(arrangement: Arrangement, spec: CameraSpec, image: ImageSpec, rng: np.random.Generator) -> _Draw | Miss:
    """A direction and a lens, and a coverage among those of the spec that the room has the distance for."""
    fov, share = draw(spec.fov, rng), float(rng.uniform())
    direction = towards(arrangement.target.yaw + draw(spec.azimuth, rng), draw(spec.elevation, rng))
    aim = arrangement.centre + rng.uniform(-1, 1, 3) * AIM_JITTER * arrangement.radius
    low, high = (max(bound, MIN_COVERAGE) for bound in spec.coverage)
    nearest = _Draw(direction=direction, aim=aim, fov=fov, image=image, wanted=high,
                    area=silhouette_area(arrangement, direction))
    reach = arrangement.shell.depth(arrangement.centre, direction, clearance_of(arrangement, spec))
    if nearest.distance > reach:
        position = arrangement.centre + direction * nearest.distance
        return Miss(reason="room", figure=nearest.distance, cause=_cause(arrangement, spec, position, "bounds"))
    low = max(low, high * (nearest.distance / reach) ** 2)
    return replace(nearest, wanted=low + share * (high - low))


def _draw_in_room(arrangement: Arrangement, spec: CameraSpec, image: ImageSpec,
                  rng: np.random.Generator) -> _Draw | Miss:
    """The first of a few drawn directions in which the room is deep enough, or the last miss."""
    drawn = _draw(arrangement, spec, image, rng)
    for _ in range(DIRECTIONS - 1):
        if isinstance(drawn, _Draw):
            break
        drawn = _draw(arrangement, spec, image, rng)
    return drawn


def _frame(arrangement: Arrangement, drawn: _Draw) -> Pinhole:
    """The drawn camera at the distance where the object's silhouette has the wanted size."""

    def at(distance: float) -> Pinhole:
        return Pinhole(position=arrangement.centre + drawn.direction * distance, target=drawn.aim, fov=drawn.fov,
                       width=drawn.image.width, height=drawn.image.height)

    distance = drawn.distance
    distance *= sqrt(min(max(look(arrangement, at(distance)).solid / drawn.wanted, 0.25), 4.0))
    return at(distance)


def _cause(arrangement: Arrangement, spec: CameraSpec, position: np.ndarray, inner: Cause) -> Cause:
    """Why a camera keeps no clearance: `room` where it is not even in the room, `close` where it is so close to the
    object that no room would give it any, else `inner`."""
    if not inside(arrangement, position, 0.0):
        return "room"
    away = float(np.linalg.norm(position - arrangement.centre))
    return "close" if away < clearance_of(arrangement, spec) + arrangement.radius else inner


def _judge(arrangement: Arrangement, spec: CameraSpec, frame: Pinhole, sight: Sight) -> Miss | None:
    """What is wrong with a frame, or None."""
    clear = float(arrangement.surfaces.distance(frame.position[None])[0])
    if clear < clearance_of(arrangement, spec):
        return Miss(reason="clearance", figure=clear, cause=_cause(arrangement, spec, frame.position, "clearance"))
    return judged(spec, sight)


def judged(spec: CameraSpec, sight: Sight) -> Miss | None:
    """What is wrong with what a frame shows of the target, or None."""
    low, high = spec.coverage
    unseen = not len(sight.points) or sight.coverage < low <= sight.solid
    if unseen or sight.visibility < spec.visibility:
        # Visibility is the share inside the frame times the share of that which nothing hides
        cut = sight.framed ** 2 < sight.visibility or not sight.framed
        return Miss(reason="hidden", figure=sight.visibility, cause="cut" if cut else "hidden")
    if low <= sight.coverage <= high:
        return None
    return Miss(reason="coverage", figure=sight.coverage, cause="coverage")


def seen_from(arrangement: Arrangement, spec: CameraSpec, frame: Pinhole) -> tuple[CameraPlan, Sight] | Miss:
    """The camera of a frame and what it sees of the target; or why it will not do: it must be in the room, clear of
    surfaces, and see the target as the spec asks."""
    if not inside(arrangement, frame.position, clearance_of(arrangement, spec)):
        away = float(np.linalg.norm(frame.position - arrangement.centre))
        return Miss(reason="room", figure=away, cause=_cause(arrangement, spec, frame.position, "bounds"))
    sight = look(arrangement, frame)
    if miss := _judge(arrangement, spec, frame, sight):
        return miss
    return CameraPlan(position=vector(frame.position), target=vector(frame.target), up=vector(frame.up), fov=frame.fov,
                      coverage=sight.coverage, visibility=sight.visibility), sight


def place_camera(arrangement: Arrangement, spec: CameraSpec, image: ImageSpec, rng: np.random.Generator,
                 where: str) -> PlannedCamera:
    """The first of at most `spec.attempts` drawn cameras that sees the target as the spec asks.

    The distance follows from the drawn coverage (orthographic silhouette area, then one correction for perspective);
    coverages that would need a larger room are not drawn.
    Raises PlanError, naming `where`, with what failed how often and what to change.
    """
    misses = list[Miss]()
    for attempt in range(spec.attempts):
        drawn = _draw_in_room(arrangement, spec, image, rng)
        found = drawn if isinstance(drawn, Miss) else seen_from(arrangement, spec, _frame(arrangement, drawn))
        if not isinstance(found, Miss):
            note = f"camera: draw {attempt + 1} of at most {spec.attempts}; {noted(misses)}".rstrip("; ")
            return PlannedCamera(camera=found[0], sight=found[1], note=note)
        misses.append(found)
    (low, high), (said, hint) = spec.coverage, explained(misses, arrangement.shell.noun)
    rule = (f"expected a camera that sees the object on {low:g} to {high:g} of the frame with visibility >= "
            f"{spec.visibility:g} and clearance >= {clearance_of(arrangement, spec):.3g} m, got none in "
            f"{spec.attempts} draws: {said}")
    raise PlanError([Problem(where=where, path="camera", rule=rule, hint=hint)])


def narrow_views(plans: Sequence[ExamplePlan]) -> list[str]:
    """One sentence for each object whose planned views all look at it from within `NARROW` degrees of their mean.

    Objects with fewer than `FEW` planned views are judged together where none has more.
    """
    ways: dict[str, list[np.ndarray]] = {}
    for plan in plans:
        ways.setdefault(plan.target.object.name, []).append(_own_direction(plan))
    if all(len(own) < FEW for own in ways.values()):
        ways = {f"each of {len(ways)} objects": [way for own in ways.values() for way in own]}
    spreads = {name: _spread(np.array(own)) for name, own in ways.items() if len(own) >= FEW}
    return [f"{len(ways[name])} views of {name} are all within {max(spread, 1):.0f} degrees of one direction: widen "
            "`camera.azimuth` and `camera.elevation`" for name, spread in spreads.items() if spread < NARROW]


def _own_direction(plan: ExamplePlan) -> np.ndarray:
    """(3,) unit vector from the object to the camera, in the object's own axes."""
    x, y, z = np.subtract(plan.camera.position, plan.camera.target)
    c, s = np.cos(yaw := radians(plan.target.yaw)), np.sin(yaw)
    return np.array([c * x + s * y, c * y - s * x, z]) / sqrt(x * x + y * y + z * z)


def _spread(ways: np.ndarray) -> float:
    """Largest angle in degrees between unit vectors (N, 3) and their mean."""
    mean = ways.mean(axis=0)
    cosines = ways @ mean / max(float(np.linalg.norm(mean)), 1e-9)
    return float(np.degrees(np.arccos(np.clip(cosines, -1, 1))).max())
