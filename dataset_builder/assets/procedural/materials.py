"""Named finishes drawn from a generator: woods, paints, cloths, leathers, metals, ceramics, stones, plasters.

Colours are linear Rec.709 reflectances; a textured material has base colour (1, 1, 1) and takes all from its texture.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.assets.procedural import textures
from dataset_builder.assets.procedural.parts import Finish
from dataset_builder.assets.procedural.textures import plausible

WOODS = {
    "oak": ((0.52, 0.34, 0.18), (0.27, 0.15, 0.065)),
    "walnut": ((0.20, 0.105, 0.055), (0.075, 0.036, 0.032)),
    "beech": ((0.60, 0.40, 0.24), (0.42, 0.24, 0.125)),
    "teak": ((0.34, 0.175, 0.075), (0.16, 0.068, 0.032)),
    "ash": ((0.66, 0.53, 0.37), (0.42, 0.29, 0.165)),
    "wenge": ((0.095, 0.062, 0.044), (0.035, 0.031, 0.03)),
}
METALS = {"chrome": ((0.55, 0.55, 0.56), 0.12), "brass": ((0.78, 0.53, 0.22), 0.24),
          "steel": ((0.46, 0.46, 0.47), 0.34),
          "blackened steel": ((0.10, 0.10, 0.105), 0.42), "copper": ((0.78, 0.42, 0.28), 0.26)}
PAINTS = {"white": (0.76, 0.75, 0.72), "cream": (0.70, 0.63, 0.49), "sage": (0.29, 0.36, 0.27),
          "navy": (0.035, 0.055, 0.11),
          "charcoal": (0.055, 0.057, 0.06), "dusty blue": (0.22, 0.32, 0.40), "terracotta": (0.42, 0.16, 0.09),
          "mustard": (0.52, 0.34, 0.07), "forest": (0.04, 0.11, 0.07)}
CLOTHS = {"natural": (0.56, 0.49, 0.38), "grey": (0.26, 0.26, 0.27), "charcoal": (0.075, 0.077, 0.085),
          "ochre": (0.50, 0.29, 0.06), "teal": (0.05, 0.19, 0.20), "rust": (0.37, 0.11, 0.05),
          "rose": (0.50, 0.26, 0.25),
          "moss": (0.16, 0.20, 0.07), "blue": (0.075, 0.13, 0.29), "ivory": (0.72, 0.68, 0.59)}
HIDES = {"cognac": (0.31, 0.115, 0.04), "black": (0.04, 0.038, 0.037), "chestnut": (0.15, 0.055, 0.035),
         "tan": (0.43, 0.24, 0.115), "oxblood": (0.15, 0.035, 0.036)}
WALLS = {"white": (0.78, 0.77, 0.74), "warm white": (0.76, 0.71, 0.62), "pale grey": (0.60, 0.61, 0.61),
         "pale green": (0.58, 0.65, 0.55), "pale blue": (0.55, 0.63, 0.68), "pale rose": (0.72, 0.60, 0.55)}
TILE_COLOURS = {"white": (0.74, 0.73, 0.70), "sand": (0.55, 0.45, 0.33), "slate": (0.14, 0.15, 0.16),
                "clay": (0.40, 0.19, 0.11)}
STONES = {"white marble": ((0.78, 0.77, 0.75), (0.34, 0.34, 0.36)),
          "black marble": ((0.04, 0.04, 0.045), (0.42, 0.40, 0.37)),
          "green marble": ((0.05, 0.12, 0.08), (0.33, 0.42, 0.35))}
GLASSES = {"clear": (0.985, 0.99, 0.985), "green": (0.62, 0.83, 0.68), "amber": (0.86, 0.55, 0.18),
           "smoke": (0.50, 0.49, 0.47), "blue": (0.45, 0.62, 0.86)}
"""What a body lets through, of each channel."""
WHITE = (1.0, 1.0, 1.0)


def _pick(rng: np.random.Generator, names: dict, name: str | None = None) -> str:  # type: ignore[type-arg]
    return name if name is not None else list(names)[int(rng.integers(len(names)))]


def _shade(rng: np.random.Generator, colour: tuple[float, float, float], spread: float = 0.10) -> np.ndarray:
    """A colour near `colour`: brighter or darker as a whole, and a little off in each channel."""
    return plausible(np.asarray(colour) * (1 + spread * rng.uniform(-1, 1)) * (1
                                                                               + 0.3 * spread * rng.uniform(-1, 1, 3)))


def _textured(name: str, texture: Texture, repeat: float, **surface: Any) -> Finish:
    return Finish(material=Material(name=name, base_color=WHITE, texture=texture, **surface), repeat=repeat)


def wood(rng: np.random.Generator, name: str | None = None) -> Finish:
    """Oiled or lacquered wood; `name` is a key of WOODS."""
    name = _pick(rng, WOODS, name)
    light, dark = (_shade(rng, colour) for colour in WOODS[name])
    texture = textures.wood(rng, light, dark, rings=int(rng.integers(7, 13)), gloss=float(rng.uniform(0.28, 0.6)))
    return _textured(name, texture, 0.5)


def paint(rng: np.random.Generator, name: str | None = None) -> Finish:
    """Painted wood, matte to glossy; `name` is a key of PAINTS."""
    name = _pick(rng, PAINTS, name)
    red, green, blue = _shade(rng, PAINTS[name]).tolist()
    gloss = float(rng.choice([0.2, 0.4, 0.6]))
    return Finish(material=Material(name=f"{name} paint", base_color=(red, green, blue), roughness=gloss))


def linen(rng: np.random.Generator, name: str | None = None) -> Finish:
    """Plain woven cloth without gloss; `name` is a key of CLOTHS."""
    name = _pick(rng, CLOTHS, name)
    warp = _shade(rng, CLOTHS[name])
    weft = plausible(warp * rng.uniform(0.7, 1.15))
    return _textured(f"{name} linen", textures.weave(rng, warp, weft), 0.2, specular=0.0)


def velvet(rng: np.random.Generator, name: str | None = None) -> Finish:
    """Velvet with a faint sheen; `name` is a key of CLOTHS."""
    name = _pick(rng, CLOTHS, name)
    return _textured(f"{name} velvet", textures.nap(rng, _shade(rng, CLOTHS[name])), 0.6, roughness=0.85)


def leather(rng: np.random.Generator, name: str | None = None) -> Finish:
    """Grained leather, half glossy; `name` is a key of HIDES."""
    name = _pick(rng, HIDES, name)
    return _textured(f"{name} leather", textures.leather(rng, _shade(rng, HIDES[name])), 0.25)


def metal(rng: np.random.Generator, name: str | None = None) -> Finish:
    """Brushed or polished metal, metallic 1; `name` is a key of METALS."""
    name = _pick(rng, METALS, name)
    colour, gloss = METALS[name]
    return _textured(name, textures.brushed(rng, np.asarray(colour), gloss=gloss), 0.3, metallic=1.0)


def ceramic(rng: np.random.Generator, name: str | None = None) -> Finish:
    """Glazed ceramic, one glossy colour; `name` is a key of PAINTS."""
    name = _pick(rng, PAINTS, name)
    red, green, blue = _shade(rng, PAINTS[name]).tolist()
    roughness = float(rng.uniform(0.1, 0.25))
    return Finish(material=Material(name=f"{name} ceramic", base_color=(red, green, blue), roughness=roughness,
                                    specular=0.05))


def glass(rng: np.random.Generator, name: str | None = None) -> Finish:
    """Solid glass, clear or tinted; `name` is a key of GLASSES."""
    name = _pick(rng, GLASSES, name)
    red, green, blue = np.minimum(np.asarray(GLASSES[name]) * (1 + 0.03 * rng.uniform(-1, 1)), 1).tolist()
    return Finish(material=Material(name=f"{name} glass", base_color=(red, green, blue), roughness=0.0,
                                    transmission=1.0, ior=1.5))


def pane() -> Finish:
    """Clear window glass, a thin sheet."""
    return Finish(material=Material(name="pane: clear glass", base_color=WHITE, roughness=0.0, transmission=1.0,
                                    ior=1.5, thin=True))


def lacquer(rng: np.random.Generator, name: str | None = None) -> Finish:
    """Paint under a clear, polished coat; `name` is a key of PAINTS."""
    name = _pick(rng, PAINTS, name)
    red, green, blue = _shade(rng, PAINTS[name]).tolist()
    return Finish(material=Material(name=f"{name} lacquer", base_color=(red, green, blue), roughness=0.5, coat=1.0,
                                    coat_roughness=float(rng.uniform(0.0, 0.1))))


def stone(rng: np.random.Generator, name: str | None = None) -> Finish:
    """Polished stone; `name` is a key of STONES."""
    name = _pick(rng, STONES, name)
    ground, vein = (_shade(rng, colour, 0.04) for colour in STONES[name])
    return _textured(name, textures.stone(rng, ground, vein), 0.8, roughness=float(rng.uniform(0.12, 0.3)))


def plaster(rng: np.random.Generator, name: str | None = None) -> Finish:
    """Matte wall paint on plaster, Lambertian; `name` is a key of WALLS."""
    name = _pick(rng, WALLS, name)
    return _textured(f"{name} plaster", textures.plaster(rng, _shade(rng, WALLS[name], 0.05)), 1.5, specular=0.0)


def boards(rng: np.random.Generator, name: str | None = None) -> Finish:
    """A floor of boards; `name` is a key of WOODS."""
    name = _pick(rng, WOODS, name)
    return _textured(f"{name} boards", textures.planks(rng, *(_shade(rng, colour) for colour in WOODS[name])), 1.2)


def tiles(rng: np.random.Generator, name: str | None = None) -> Finish:
    """Glossy square tiles; `name` is a key of TILE_COLOURS."""
    name = _pick(rng, TILE_COLOURS, name)
    return _textured(f"{name} tiles", textures.tiles(rng, _shade(rng, TILE_COLOURS[name])), 1.2)


def floor(rng: np.random.Generator) -> Finish:
    """Boards or tiles."""
    return boards(rng) if rng.uniform() < 0.65 else tiles(rng)


def books(rng: np.random.Generator) -> Finish:
    """Cloth bindings in many colours; parts pick a patch."""
    return _textured("book cloth", textures.book_cloth(rng), 8.0, roughness=0.7)


def leaf(rng: np.random.Generator) -> Finish:
    """Leaves, darker and lighter in stripes across."""
    green = _shade(rng, (0.09, 0.20, 0.05), 0.3)
    texture = textures.wood(rng, green, plausible(0.4 * green), rings=3, gloss=0.4)
    return _textured("leaf", texture, 0.15)


def soil(rng: np.random.Generator) -> Finish:
    """Dry soil."""
    return _textured("soil", textures.nap(rng, np.array([0.06, 0.045, 0.034])), 0.1, specular=0.0)


def one_of(rng: np.random.Generator, *makers: Callable[[np.random.Generator], Finish]) -> Finish:
    """A finish by one of the `makers`, each as likely."""
    return makers[int(rng.integers(len(makers)))](rng)


def frame(rng: np.random.Generator) -> Finish:
    """What frames and carcasses are made of: mostly wood, sometimes painted."""
    return one_of(rng, wood, wood, wood, paint)


def cover(rng: np.random.Generator) -> Finish:
    """What seats are covered with."""
    return one_of(rng, linen, linen, velvet, leather)


FAMILIES_OF_FINISHES: dict[str, tuple[Callable[[np.random.Generator, str | None], Finish], dict[str, Any]]] = {
    "plaster": (plaster, WALLS), "paint": (paint, PAINTS), "boards": (boards, WOODS), "tiles": (tiles, TILE_COLOURS),
    "wood": (wood, WOODS), "stone": (stone, STONES), "metal": (metal, METALS), "ceramic": (ceramic, PAINTS),
    "lacquer": (lacquer, PAINTS), "linen": (linen, CLOTHS), "velvet": (velvet, CLOTHS)}
"""Finishes that rooms may ask for by `spec.scene.FinishName`: what makes them, and the tones that each has."""
