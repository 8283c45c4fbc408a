"""The plan of what is simulated and what is not, and why."""

from typing import Literal

from dataset_builder.layers import Extent, Pass
from dataset_builder.spec.model import Model


class Decision(Model):
    """One thing that is simulated or not, and why."""

    effect: str
    """What was decided on."""
    choice: str
    """What was chosen, in a word or figure."""
    reason: str
    """Why, in one sentence."""


Feature = Literal["textures", "specular", "coat", "sheen", "glass", "thin", "dispersion", "fog"]
"""What a kernel can do beyond Lambertian surfaces in clear air: the rendering kernels are compiled with those that the
scene calls for."""


class PassEffects(Model):
    """What one pass simulates."""

    name: Pass
    """Of the pass."""
    extent: Extent
    """Pixels that it is traced on."""
    lights: tuple[int, ...]
    """Which of its illumination's lights, by their place there."""
    max_depth: int
    """Longest path in edges; 2 is direct light."""


class EffectsPlan(Model):
    """Which effects an example's passes simulate, decided from its plan and its materials; see `planning.effects`."""

    features: tuple[Feature, ...]
    """What the scene calls for beyond Lambertian surfaces in clear air."""
    passes: tuple[PassEffects, ...]
    """One of every pass, needed or not."""
    decisions: tuple[Decision, ...]
    """Every choice with its reason."""

    def of(self, name: str) -> PassEffects:
        """What the pass `name` simulates."""
        return next(entry for entry in self.passes if entry.name == name)
