"""What the attributes of a UsdLux prim say: brightness, colour, and what of them is not honoured.

Formulas are those of the schema's own documentation: https://openusd.org/release/api/class_usd_lux_light_a_p_i.html
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import exp2
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dataset_builder.assets.file_model import counted, refuse
from dataset_builder.assets.light_bounds import MOST_RADIANCE, bounded
from dataset_builder.errors import printable

if TYPE_CHECKING:
    from pxr import Usd

TEMPERATURES = (1000.0, 10000.0)
"""Kelvin for which UsdLux defines colours."""
OLD = ("intensity", "exposure", "color", "normalize", "radius", "width", "height", "length", "angle", "texture:file",
       "enableColorTemperature", "colorTemperature", "shaping:cone:angle")
"""Inputs that had these names before 2021."""
UNPHYSICAL: tuple[tuple[str, tuple[float, ...], str], ...] = (
    ("diffuse", (1,), "multiplier of the diffuse response"), ("specular", (1,), "multiplier of the specular response"),
    ("shadow:enable", (1,), "shadows switched off"), ("shadow:color", (0, 0, 0), "colour of shadows"),
    ("shadow:distance", (-1,), "largest distance of shadows"), ("shadow:falloff", (-1,), "fall-off of shadows"))
"""Inputs that no physical light has, the value that switches each off, and what each is."""
LINKS = (("lightLink", "light linking"), ("shadowLink", "shadow linking"))


@dataclass(kw_only=True, eq=False)
class LightInputs:
    """The inputs of one light at the first time of its stage."""

    path: Path
    """Of the stage, for messages."""
    prim: "Usd.Prim"
    said: list[str] = field(default_factory=list)
    """What is not honoured, in words."""

    @property
    def name(self) -> str:
        """Path of the prim."""
        return str(self.prim.GetPath())

    def value(self, name: str, default: Any = None) -> Any:
        """Of `inputs:NAME`, or of the attribute NAME; said where it should come from elsewhere."""
        from pxr import Usd

        attributes = [each for key in (f"inputs:{name}", name) if (each := self.prim.GetAttribute(key))]
        if not attributes:
            return default
        attribute = next((each for each in attributes if each.IsAuthored()), attributes[0])
        if attribute.HasAuthoredConnections():
            self.say(f"what feeds {attribute.GetName()}")
        value = attribute.Get(Usd.TimeCode.EarliestTime())
        return default if value is None else value

    def number(self, name: str, default: float, *, low: float = 0.0, high: float = MOST_RADIANCE) -> float:
        """As `value`. Raises UserError for what is not in [low, high]."""
        value = self.value(name, default)
        return bounded(self.path, self.name, name, float(value) if isinstance(value, int | float) else np.nan, low=low,
                       high=high)

    def numbers(self, name: str, default: Sequence[float]) -> np.ndarray:
        """As `value`, as many numbers as `default` has. Raises UserError for anything else."""
        value = self.value(name, default)
        try:
            found = np.asarray(value, dtype=np.float64).reshape(len(default))
        except (TypeError, ValueError):
            refuse(self.path, f"expected {name} to be {counted(len(default), 'number')}, got {printable(str(value))}",
                   at=self.name)
        return found

    def say(self, what: str) -> None:
        """Add something that is not honoured, once."""
        if what not in self.said:
            self.said.append(what)

    def colour(self) -> np.ndarray:
        """(3,) colour times that of the colour temperature, where it is enabled; linear Rec.709."""
        from pxr import UsdLux

        colour = self.numbers("color", (1.0, 1.0, 1.0))
        for value in colour:
            bounded(self.path, self.name, "color", float(value))
        if not self.value("enableColorTemperature", False):
            return colour
        kelvin = self.temperature()
        low, high = TEMPERATURES
        if not low <= kelvin <= high:
            self.say(f"colorTemperature {kelvin:g}, taken as the nearest in [{low:g}, {high:g}]")
        return colour * np.array(UsdLux.BlackbodyTemperatureAsRgb(float(np.clip(kelvin, low, high))), dtype=np.float64)

    def temperature(self) -> float:
        """Colour temperature in kelvin, 0 where it is not enabled."""
        enabled = self.value("enableColorTemperature", False)
        return self.number("colorTemperature", 6500.0, low=1.0, high=1e6) if enabled else 0.0

    def emission(self) -> np.ndarray:
        """(3,) intensity times 2^exposure times colour. Raises UserError for numbers that no light has."""
        intensity = self.number("intensity", 1.0)
        exposure = self.number("exposure", 0.0, low=-100.0, high=100.0)
        total = intensity * exp2(exposure) * self.colour()
        bounded(self.path, self.name, "intensity x 2^exposure x color", float(total.max()))
        return total

    def name_the_rest(self) -> None:
        """Say what applies to lights of every kind and is not honoured."""
        for name, plain, what in UNPHYSICAL:
            found = self.numbers(name, plain)
            if not np.allclose(found, plain):
                self.say(f"{what} ({name} {' '.join(f'{number:g}' for number in found)})")
        for old in OLD:
            attribute = self.prim.GetAttribute(old)
            if attribute and attribute.IsAuthored() and not self.prim.GetAttribute(f"inputs:{old}").IsAuthored():
                self.say(f"{old} without `inputs:`, as before 2021, read as today's")
        for key, what in LINKS:
            if self._links(key):
                self.say(f"{what}; it lights everything")
        for relation, what in (("light:filters", "light filters"), ("portals", "portals")):
            if self.prim.GetRelationship(relation) and self.prim.GetRelationship(relation).HasAuthoredTargets():
                self.say(what)

    def _links(self, key: str) -> bool:
        """Whether a collection leaves anything out."""
        from pxr import Usd

        if not self.prim.HasAPI(Usd.CollectionAPI, key):
            return False
        links = Usd.CollectionAPI(self.prim, key)
        named = links.GetIncludesRel().HasAuthoredTargets() or links.GetExcludesRel().HasAuthoredTargets()
        return bool(named or links.GetIncludeRootAttr().Get() is False)
