"""The one table of light kinds: what a light of each kind is given by. Everything else reads it.

Formulas and emitters of a kind stand in tables by its name, where they are used: a kind that one of them lacks is a
KeyError there. Keys of specs and labels are the names.
"""

from dataclasses import dataclass
from typing import Literal

LightName = Literal["dome", "sun", "area", "sphere", "point", "spot", "disk", "cylinder"]
LampName = Literal["area", "sphere", "spot", "point"]
"""Kinds that stand in the room and that a spec may ask for by name; files have the others, too."""
Quantity = Literal["radiance", "irradiance", "intensity"]
"""W/(m^2 sr), W/m^2 and W/sr."""
Image = Literal["", "environment", "texture"]
LENGTHS: dict[Quantity, int] = {"radiance": 0, "irradiance": 0, "intensity": 2}
"""Power of a length that each quantity grows with where a scene is scaled and the picture stays the same."""


@dataclass(frozen=True, kw_only=True)
class LightKind:
    """One kind of light."""

    name: LightName
    quantity: Quantity
    """What its colour measures."""
    sized: bool = False
    """Whether it has a side or radius."""
    long: bool = False
    """Whether it has a length that it cannot be without."""
    aimed: bool = False
    """Whether it has a direction."""
    beamed: bool = False
    """Whether it has a cutoff angle."""
    outside: bool = False
    """Whether it shines from outside the room, from no place in it."""
    image: Image = ""
    """Kind of image that it may show, empty for none."""
    slots: int = 0
    """Most emitters of the kind in a scene, 0 for as many as it has lights."""
    spare: bool = True
    """Whether scenes without a light of the kind hold a dark one, so that they share a kernel with those that have."""

    @property
    def all_round(self) -> bool:
        """Whether it shines from every direction at once, as a sky does."""
        return self.outside and not self.aimed

    @property
    def parallel(self) -> bool:
        """Whether it shines from one direction everywhere, as a sun does."""
        return self.outside and self.aimed

    @property
    def extended(self) -> bool:
        """Whether a path can meet it; the others can only be connected to."""
        return self.quantity == "radiance"


LIGHT_KINDS: dict[LightName, LightKind] = {kind.name: kind for kind in (
    LightKind(name="dome", quantity="radiance", outside=True, image="environment", slots=1),
    LightKind(name="sun", quantity="irradiance", aimed=True, outside=True),
    LightKind(name="area", quantity="radiance", sized=True, aimed=True, image="texture"),
    LightKind(name="sphere", quantity="radiance", sized=True),
    LightKind(name="point", quantity="intensity"),
    LightKind(name="spot", quantity="intensity", aimed=True, beamed=True),
    LightKind(name="disk", quantity="radiance", sized=True, aimed=True, spare=False),
    LightKind(name="cylinder", quantity="radiance", sized=True, aimed=True, long=True, spare=False),
)}
"""Every kind by name, in the order that scenes hold their emitters."""
