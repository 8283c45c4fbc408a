"""Lamps that stay where a spec puts them."""

from typing import Annotated, Any, Literal

from pydantic import Field, Tag, model_validator

from dataset_builder.light_kinds import LIGHT_KINDS, LampName
from dataset_builder.spec.hex_colour import MaybeColour
from dataset_builder.spec.model import Model, broken
from dataset_builder.spec.numbers import AnyNumber, branches, draws, support, within

Three = tuple[AnyNumber, AnyNumber, AnyNumber]
LampAim = Annotated[
    Annotated[Literal["object"], Tag("|object")] | Annotated[Three, Tag("|point")],
    branches(lambda value: "|point" if isinstance(value, (list, tuple)) else "|object" if value == "object" else None,
             "expected `object` or a point [x, y, z]"),
]
ABOUT = ("azimuth", "elevation", "distance")
"""Keys of a place about the object."""


class LampSpec(Model):
    """A lamp that stays where it is put. What is left out of `elevation`, `distance`, `size`, `cutoff`, `strength` and
    `temperature` is that of `target`."""

    name: Annotated[str, Field(pattern=r"^[^\n]*$", max_length=100)] = ""
    """What messages and labels call it."""
    kind: LampName = "area"
    """What shines; a square shines to one side, a spot in a cone, the others all round."""
    position: Three | None = None
    """Of its middle: metres in the room, z upwards, the origin in the middle of the floor; of a scene file, as it has
    them. Either this or `azimuth`."""
    azimuth: AnyNumber | None = None
    """Degrees about the object, as of cameras: 0 is in front of it, 90 to the right of who looks at its front."""
    elevation: within(low=-90, high=90) | None = None  # type: ignore[valid-type]
    """Degrees above the horizontal plane through the object's centre, beside `azimuth`."""
    distance: within(low=0.05) | None = None  # type: ignore[valid-type]
    """Metres from the object's centre, beside `azimuth`."""
    aim: LampAim = "object"
    """What a square or a spot shines at: the middle of the object, or a point in the room."""
    direction: Three | None = None
    """Direction that it shines in, in place of `aim`; its length does not matter."""
    size: within(low=1e-4) | None = None  # type: ignore[valid-type]
    """Side of an area light or radius of a sphere light, metres."""
    cutoff: within(low=1, high=89) | None = None  # type: ignore[valid-type]
    """Half angle of a spot in degrees."""
    strength: within(low=0) | None = None  # type: ignore[valid-type]
    """Irradiance that it sends to what faces it, on its axis, as far away as the object's centre, with nothing in the
    way, in units of the source dome's."""
    radiance: within(low=0) | None = None  # type: ignore[valid-type]
    """In place of `strength`, what it sends wherever the object is: radiance of a square or a sphere in units of the
    source dome's; of a spot or a point, intensity in these units times a square metre."""
    temperature: within(low=1000, high=40000) | None = None  # type: ignore[valid-type]
    """Colour temperature in kelvin."""
    color: MaybeColour = None
    """In place of `temperature`: linear Rec.709, or sRGB as `"#rrggbb"`. It tints the light and does not dim it."""
    texture: str = ""
    """Image (.exr .png) that an area light shows, relative to the dataset file; normalised to mean luminance 1."""
    on: bool = True
    """Whether it shines at all."""
    dim: within(low=0, high=1e6) = 1.0  # type: ignore[valid-type]
    """Factor of what it sends; 0 is off."""

    @property
    def shines(self) -> bool:
        """Whether it is on in any draw."""
        return self.on and support(self.dim)[1] > 0

    def asks(self, key: str) -> bool:
        """Whether `target`'s number of that name is this lamp's."""
        kind, instead = LIGHT_KINDS[self.kind], {"strength": self.radiance, "temperature": self.color}
        has = {"elevation": self.azimuth is not None, "distance": self.azimuth is not None, "size": kind.sized,
               "cutoff": kind.beamed}
        return getattr(self, key) is None and has.get(key, instead.get(key) is None)

    @model_validator(mode="after")
    def _one_of_each(self) -> "LampSpec":
        if (self.position is None) == (self.azimuth is None):
            got = "neither" if self.position is None else "both"
            raise broken(f"expected exactly one of `position` and `azimuth`, got {got}")
        for name, other in (("position", "elevation"), ("position", "distance"), ("strength", "radiance"),
                            ("temperature", "color")):
            if getattr(self, name) is not None and getattr(self, other) is not None:
                raise broken(f"expected no `{other}` beside `{name}`, got both", path=(other,))
        if self.direction is not None and self.aim != "object":
            raise broken("expected no `aim` beside `direction`, got both", path=("aim",))
        if self.aim == self.position and not any(map(draws, self.aim)):
            raise broken("expected a point other than `position`", path=("aim",))
        for name in ("direction", "color"):
            if not any(_may_be_more(number) for number in getattr(self, name) or (1,)):
                raise broken(f"expected a {name} with a number that is not 0, got all 0", path=(name,))
        return self

    @model_validator(mode="after")
    def _of_its_kind(self) -> "LampSpec":
        kind, wrong = LIGHT_KINDS[self.kind], ""
        if not kind.aimed and (self.direction is not None or self.aim != "object"):
            wrong = "direction" if self.direction is not None else "aim"
        for name, has in (("size", kind.sized), ("cutoff", kind.beamed), ("texture", kind.image == "texture")):
            wrong = name if not has and getattr(self, name) else wrong
        if wrong:
            raise broken(f"expected no `{wrong}` of a light of kind {self.kind}, which has none", path=(wrong,))
        return self


def _may_be_more(number: Any) -> bool:
    return support(number) != (0.0, 0.0)
