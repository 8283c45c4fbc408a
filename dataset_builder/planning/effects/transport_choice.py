"""By which paths a pass finds light that has bounced: from the camera alone, or joined with paths from the lamps.

`RULES` is the whole of it: the first rule that holds has camera paths, and where none does, paths are joined.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from dataset_builder.assets.asset import ripples
from dataset_builder.assets.glass_bodies import fill_of
from dataset_builder.label.example_plan import Decision, Transport
from dataset_builder.label.scene_plan import FogPlan, LightPlan, Vector
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.effects.features import names
from dataset_builder.planning.effects.materials_used import MaterialUse

DIRECT = 2
"""Edges of the longest path of direct light."""
LAMPS_LEAD = 0.5
"""Least share of the light at the object that lamps have where paths are joined; the rest comes from outside, where no
light path starts."""
CHOICES: dict[Transport, str] = {"camera": "camera paths", "joined": "joined paths"}
"""Transports as decisions name them."""


@dataclass(frozen=True, kw_only=True)
class PassLight:
    """What light does in one pass, as far as planning knows."""

    name: str
    """Of the pass."""
    lights: tuple[LightPlan, ...]
    """Those that reach the object."""
    materials: tuple[MaterialUse, ...]
    """Of what is not taken away."""
    fog: FogPlan
    depth: int
    """Longest path in edges."""
    target_area: float
    """Surface of the target, square metres."""
    place: Vector = (0.0, 0.0, 0.0)
    """Where the target stands, metres."""
    pixels: int = 128 * 128
    """Of the frame."""
    spp: int = 64
    """Samples per pixel; the most, where sampling goes on to a goal."""
    batches: int = 4
    """That these are taken in, each with light paths of its own."""

    @property
    def lamps(self) -> tuple[LightPlan, ...]:
        """Lights that stand in the scene and shine, where light paths start."""
        return tuple(light for light in self.lights
                     if not LIGHT_KINDS[light.kind].outside and light.weight > 0 and any(light.radiance))

    @property
    def share(self) -> float:
        """Of the irradiance at the object, what lamps send: 0 to 1, 0 where there is none at all."""
        total = sum(light.weight for light in self.lights)
        return sum(light.weight for light in self.lamps) / total if total else 0.0


@dataclass(frozen=True, kw_only=True)
class TransportRule:
    """One reason for camera paths."""

    bars: bool
    """Whether joined paths are impossible there, rather than not worth while."""
    holds: Callable[[PassLight], bool]
    why: Callable[[PassLight], str]


def _no_lamp(light: PassLight) -> str:
    if not light.lights:
        return "no light reaches the object"
    if all(LIGHT_KINDS[each.kind].outside for each in light.lights):
        return f"{kinds(light.lights)} shines from outside alone, and light paths start at lamps in the scene"
    return "its lamps are dark, and light paths start at them"


RULES = (
    TransportRule(
        bars=True, holds=lambda light: light.depth <= DIRECT,
        why=lambda light: f"paths of {light.depth} edges are direct light alone, and there is nothing to join"),
    TransportRule(
        bars=True, holds=lambda light: not light.lamps,
        why=lambda light: _no_lamp(light)),
    TransportRule(
        bars=True, holds=lambda light: light.fog.extinction > 0,
        why=lambda light: "fog fills the air, and light paths do not scatter in it"),
    TransportRule(
        bars=True, holds=lambda light: any(ripples(use.material) for use in light.materials),
        why=lambda light: "light that crosses a normal map on glass goes another way from the lamp than from the "
                          "camera: " + names([use.name for use in light.materials if ripples(use.material)])),
    TransportRule(
        bars=True, holds=lambda light: any(fill_of(use.material) for use in light.materials),
        why=lambda light: "light paths do not count the bodies of glass that they are in: " + names(
            [use.name for use in light.materials if fill_of(use.material)])),
    TransportRule(
        bars=False, holds=lambda light: light.share < LAMPS_LEAD,
        why=lambda light: f"lamps have {light.share:.0%} of the direct light at the object, less than "
                          f"{LAMPS_LEAD:.0%}, and no light path starts outside"),
)
"""Where paths start at the camera alone, in the order that they are asked."""
EVERYTHING = "light paths know no fog"
"""What bars joined paths where everything is simulated."""


def kinds(lights: Sequence[LightPlan]) -> str:
    """The kinds of some lights in words: `area, dome and sphere light`."""
    *others, last = sorted({light.kind for light in lights})
    return f"{', '.join(others)} and {last} light" if others else f"{last} light"


def choose(light: PassLight, asked: str) -> tuple[Transport, Decision]:
    """The transport of a pass, and why. asked: `render.transport`; what cannot be had is replaced, and that is said."""
    barred = [rule for rule in RULES if rule.bars and rule.holds(light)]
    if asked == "camera":
        return "camera", _said(light.name, "camera", "as requested")
    if asked == "joined":
        return _requested(light.name, barred[0].why(light) if barred else "")
    against = [rule for rule in RULES if rule.holds(light)]
    if against:
        return "camera", _said(light.name, "camera", against[0].why(light))
    return "joined", _said(light.name, "joined", f"{kinds(light.lamps)} from within the scene is "
                           f"{light.share:.0%} of the direct light at the object, and it bounces")


def choose_for_everything(name: str, asked: str, reason: str) -> tuple[Transport, Decision]:
    """The transport where every effect is simulated, needed or not: kernels with fog have one.

    reason: why everything is.
    """
    if asked == "joined":
        return _requested(name, EVERYTHING)
    return "camera", _said(name, "camera", "as requested" if asked == "camera" else f"{reason}; {EVERYTHING}")


def _requested(name: str, barred: str) -> tuple[Transport, Decision]:
    """What becomes of a request for joined paths."""
    if barred:
        return "camera", _said(name, "camera", f"joined paths are requested, but {barred}")
    return "joined", _said(name, "joined", "as requested")


def _said(name: str, transport: Transport, reason: str) -> Decision:
    return Decision(effect=f"transport of {name}", choice=CHOICES[transport], reason=reason)
