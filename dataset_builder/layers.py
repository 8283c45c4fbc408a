"""The one table of layers: names, units, ranges and types. Everything else reads it.

The definitions are in `docs/layers.md`; the identifiers are the same in specs, in code and as members of a shard.
"""

from dataclasses import dataclass, replace
from typing import Literal

Geometry = Literal["3dm", "r3dm", "field"]
Extent = Literal["object", "frame"]
Pass = Literal["source", "target", "rough", "first_hit", "first_hit_rough", "source_clean", "empty", "pbr"]
PASSES: tuple[Pass, ...] = ("first_hit", "source", "source_clean", "target", "first_hit_rough", "rough", "pbr", "empty")
"""In the order that they run and plans tell of them; records keep that of `Pass`."""
LIT: tuple[Pass, ...] = ("source", "source_clean", "target", "rough", "pbr", "empty")
"""Those that need light."""
ALIKE: tuple[Pass, ...] = ("target", "pbr", "empty")
"""The same view under the target light with the 3DM, with the R3DM and without: they share spp and random numbers, so
that differences between them are smooth."""
EVERYWHERE = ("mask", "mask_rough", "mask_field", "instance")
"""Layers that say by themselves where the object is, so that their extent is no matter."""


INF = float("inf")
RADIANCE = "W/(m^2 sr), scene-referred linear Rec.709"


@dataclass(frozen=True, kw_only=True)
class Layer:
    """One layer of an example."""

    name: str
    """Identifier."""
    symbol: str
    """The paper's."""
    geometry: Geometry
    """Which mesh of the target object it shows; `field` is what `i_s` shows, whatever that is."""
    render_pass: Pass
    """The pass that makes it."""
    channels: int
    """3 (R, G, B) or 1 (Y)."""
    low: float
    """Least valid value."""
    high: float
    """Largest valid value."""
    unit: str
    meaning: str
    """In one sentence."""
    of: str = ""
    """The layer that it says something more about, such as its standard error; empty for one of its own."""

    @property
    def radiometric(self) -> bool:
        """True where the value needs light, so that it has Monte Carlo noise and a standard error."""
        return self.render_pass in LIT and self.unit == RADIANCE


_TABLE = (
    Layer(name="i_s", symbol="I_s", geometry="3dm", render_pass="source", channels=3, low=0, high=INF, unit=RADIANCE,
          meaning="outgoing radiance of the clean mesh under the source illumination (uniform sunlight)"),
    Layer(name="d", symbol="D-bar", geometry="3dm", render_pass="first_hit", channels=3, low=0, high=1, unit="1",
          meaning="diffuse reflectance: integral of f_d cos over the hemisphere, seen from the camera"),
    Layer(name="r", symbol="R-bar", geometry="3dm", render_pass="first_hit", channels=3, low=0, high=1, unit="1",
          meaning="directional reflectance of the specular lobes: integral of f_s cos, seen from the camera"),
    Layer(name="i_t", symbol="I_t-bar", geometry="3dm", render_pass="target", channels=3, low=0, high=INF,
          unit=RADIANCE, meaning="outgoing radiance of the clean mesh under the target illumination"),
    Layer(name="s_prime", symbol="S'", geometry="r3dm", render_pass="rough", channels=3, low=0, high=INF, unit=RADIANCE,
          meaning="raw lighting on the rough mesh: the radiance that a white Lambertian first surface would reflect"),
    Layer(name="mask", symbol="M", geometry="3dm", render_pass="first_hit", channels=1, low=0, high=1, unit="1",
          meaning="share of the pixel that the target object covers (box filter)"),
    Layer(name="s", symbol="S", geometry="3dm", render_pass="target", channels=3, low=0, high=INF, unit=RADIANCE,
          meaning="raw lighting on the clean mesh under the target illumination"),
    Layer(name="spec", symbol="R R_l", geometry="3dm", render_pass="target", channels=3, low=0, high=INF, unit=RADIANCE,
          meaning="the part of i_t from specular lobes and emission of the first surface"),
    Layer(name="air", symbol="A", geometry="3dm", render_pass="target", channels=3, low=-INF, high=INF, unit=RADIANCE,
          meaning="what fog adds to i_t between camera and first surface, less what it absorbs or scatters away; 0 "
                  "without fog"),
    Layer(name="i_t_empty", symbol="I_0", geometry="3dm", render_pass="empty", channels=3, low=0, high=INF,
          unit=RADIANCE, meaning="outgoing radiance of the scene without the target object under the target "
                                 "illumination"),
    Layer(name="i_pbr", symbol="I_PBR", geometry="r3dm", render_pass="pbr", channels=3, low=0, high=INF,
          unit=RADIANCE, meaning="outgoing radiance of the scene with the rough mesh in it under the target "
                                 "illumination"),
    Layer(name="mask_rough", symbol="M'", geometry="r3dm", render_pass="first_hit_rough", channels=1, low=0, high=1,
          unit="1", meaning="share of the pixel that the rough mesh of the target object covers"),
    Layer(name="depth", symbol="z", geometry="3dm", render_pass="first_hit", channels=1, low=0, high=INF, unit="m",
          meaning="distance along the view axis to the first surface, mean over the samples that hit one; 0 for none"),
    Layer(name="normal", symbol="n", geometry="3dm", render_pass="first_hit", channels=3, low=-1, high=1, unit="1",
          meaning="mean shading normal in world space, turned to the viewer; 0 where no surface is"),
    Layer(name="normal_rough", symbol="n'", geometry="r3dm", render_pass="first_hit_rough", channels=3, low=-1, high=1,
          unit="1", meaning="as normal, on the rough mesh"),
    Layer(name="instance", symbol="id", geometry="3dm", render_pass="first_hit", channels=1, low=0, high=65504,
          unit="id", meaning="object at the pixel's centre: 0 none, 1 target, 2 room, 3.. furniture in plan order"),
    Layer(name="i_s_clean", symbol="I_s", geometry="3dm", render_pass="source_clean", channels=3, low=0, high=INF,
          unit=RADIANCE,
          meaning="i_s rendered from the clean mesh, where i_s is a field's image; else the same as i_s"),
    Layer(name="mask_field", symbol="M_f", geometry="field", render_pass="source", channels=1, low=0, high=1, unit="1",
          meaning="opacity of what i_s shows: of the field, seen alone; the same as mask where i_s is rendered"),
)

_ERRORS = tuple(
    Layer(name=f"{layer.name}_se", symbol=f"se({layer.symbol})", geometry=layer.geometry, render_pass=layer.render_pass,
          channels=layer.channels, low=0, high=INF, unit=layer.unit,
          meaning=f"standard error of {layer.name}, per pixel", of=layer.name)
    for layer in _TABLE if layer.radiometric
)

DENOISABLE = ("i_s", "i_t", "s", "s_prime")
"""Layers that may be denoised."""

_RAW = tuple(replace(layer, name=f"{layer.name}_raw", symbol=f"raw({layer.symbol})",
                     meaning=f"{layer.name} before denoising", of=layer.name) for layer in _TABLE
             if layer.name in DENOISABLE)

HALF = "i_t_half"
_HALVES = tuple(replace(layer, name=HALF, symbol=f"half({layer.symbol})", of=layer.name,
                        meaning=f"mean of the first half of the samples of {layer.name}; 2 {layer.name} - {HALF} is "
                                "that of the others, which is independent of it")
                for layer in _TABLE if layer.name == "i_t")

LAYERS: dict[str, Layer] = {layer.name: layer for layer in (*_TABLE, *_ERRORS, *_RAW, *_HALVES)}
"""Every layer by name: the paper's six, then the free ones, then standard errors, layers before denoising, and means of
half of the samples."""

PAPER_LAYERS = ("i_s", "d", "r", "i_t", "s_prime", "mask")
"""The tuple of the paper (section 5.1.1), which every dataset holds unless its spec says otherwise."""


def sampled_as(render_pass: str) -> str:
    """The pass whose spp and random numbers a pass has."""
    return "target" if render_pass in ALIKE else render_pass.removesuffix("_clean")


def layers_of(render_pass: Pass) -> tuple[str, ...]:
    """Names of the layers that one pass can make, in table order."""
    return tuple(name for name, layer in LAYERS.items() if layer.render_pass == render_pass)
