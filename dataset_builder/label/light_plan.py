"""The plan of the light of one pass."""

from pydantic import Field

from dataset_builder.label.scene_plan import Vector
from dataset_builder.light_kinds import LightName
from dataset_builder.spec.model import Model


class LightPlan(Model):
    """One emitter. Unused fields are 0; `radiance` holds the emitter's natural unit, per channel.

    dome: radiance from everywhere. sun: irradiance on a surface facing it, travelling along `direction`.
    area: a square of side `size` whose normal is `direction`, radiance. sphere: radius `size`, radiance.
    point: radiant intensity. spot: radiant intensity on its axis `direction`, `cutoff` degrees to its edge.
    """

    kind: LightName
    """What emits; see above for what the other keys mean by kind."""
    position: Vector
    """Of its middle, metres."""
    direction: Vector
    """Unit vector that the light leaves along."""
    size: float
    """Side of a square or radius of a ball, metres."""
    cutoff: float
    """Degrees from the axis of a spot to its edge."""
    radiance: Vector
    """Red, green, blue, linear Rec.709, 0 or more: W/(m^2 sr) of a dome, area or sphere, W/m^2 of a sun, W/sr of a
    point or spot."""
    temperature: float
    """Colour temperature in kelvin that the colour was drawn from; 0 where it was not."""
    image: str = ""
    """Image that multiplies the radiance, as the spec gives it: latitude-longitude of a dome, texture of an area light,
    brought to mean 1; empty for none."""
    image_sha256: str = ""
    """SHA-256 of the image's file; empty for none."""
    turn: float = 0.0
    """Degrees that a dome's image is turned about +Z."""
    weight: float = Field(ge=0)
    """Irradiance (mean of channels) at the target object, W/m^2, which light sampling is proportional to: unoccluded
    for lamps and for the source, what gets in for target lights outside. Images count as their mean."""


class IlluminationPlan(Model):
    """All light of one pass, and what is taken out of its way."""

    lights: tuple[LightPlan, ...]
    """Every emitter; passes name them by their place here, from 0."""
    open: tuple[str, ...]
    """Room parts left out of this pass: `ceiling`, `walls`."""
