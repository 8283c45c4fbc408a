"""How large things usually are, by the word for them; and what a size that is not usual may come from."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from math import log
from typing import Literal

SENSE = (0.02, 20.0)
"""Least and largest extent, in metres, of what is put on a floor: common sense where a category says nothing."""
LIKELY = (0.05, 3.0)
"""What such a thing most likely measures; proposed scales aim at its middle."""
BEYOND = 10.0
"""How many times out of its usual range a size cannot be meant."""
LIES, STANDS = 1.4, 2.0
"""How many times one extent exceeds the other before another axis is proposed to be up."""
UNITS = {1.0: "metres", 0.01: "centimetres", 0.001: "millimetres", 0.0254: "inches", 0.3048: "feet", 0.1: "decimetres",
         10.0: "units of 10 m", 100.0: "units of 100 m", 1000.0: "kilometres"}
"""Scales that are proposed, and the unit of a file that needs them; of two that fit equally, the first."""
OWN_UNIT = {".glb": "glTF is in metres by definition", ".gltf": "glTF is in metres by definition",
            ".usd": "USD names its own unit", ".usda": "USD names its own unit", ".usdc": "USD names its own unit",
            ".usdz": "USD names its own unit"}
"""Formats that say how long a unit is. In the others it is anything."""
Lengths = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Usual:
    """One kind of thing."""

    name: str
    """The category that it is called by."""
    low: float
    """Metres; of its largest extent, at the least."""
    high: float
    """Metres; of its largest extent, at the most."""
    words: tuple[str, ...] = ()
    """What else it is called."""
    shape: Literal["low", "tall", ""] = ""
    """low: its height is its least extent. tall: it is much higher than deep."""


def _usual(name: str, low: float, high: float, *words: str, shape: Literal["low", "tall", ""] = "") -> Usual:
    return Usual(name=name, low=low, high=high, words=words, shape=shape)


USUAL = (
    _usual("chair", 0.4, 1.5, "seat", "rocker"), _usual("armchair", 0.5, 1.6, "arm chair", "recliner", "lounge chair"),
    _usual("stool", 0.2, 1.3, "barstool", "footstool"), _usual("bench", 0.4, 4.0, "pew"),
    _usual("sofa", 0.9, 5.0, "couch", "settee", "loveseat", "chesterfield"),
    _usual("ottoman", 0.25, 1.5, "pouf", "hassock"),
    _usual("table", 0.25, 5.0, "coffeetable", "sidetable"), _usual("desk", 0.6, 3.5, "bureau"),
    _usual("nightstand", 0.25, 1.2, "night stand", "bedside table", "night table"),
    _usual("cabinet", 0.25, 3.5, "cupboard", "sideboard", "dresser", "commode", "drawer", "credenza", "buffet",
           "chest", "tv stand"),
    _usual("bookshelf", 0.25, 4.5, "bookcase", "shelf", "shelving", "shelve"),
    _usual("wardrobe", 1.0, 4.5, "armoire", "closet", shape="tall"),
    _usual("bed", 0.9, 3.5, shape="low"), _usual("bunk bed", 1.0, 3.5), _usual("crib", 0.6, 1.8, "cradle"),
    _usual("mattress", 0.6, 2.6, shape="low"),
    _usual("lamp", 0.1, 3.5, "light", "lantern", "sconce", "luminaire"), _usual("chandelier", 0.2, 4.0),
    _usual("floor lamp", 0.8, 3.0, shape="tall"), _usual("candle", 0.02, 1.0, "candlestick", "candelabra"),
    _usual("vase", 0.05, 1.8, "urn", "amphora"), _usual("plant", 0.05, 5.0, "flower", "cactus", "fern", "palm", "bush"),
    _usual("tree", 0.2, 20.0), _usual("rug", 0.3, 10.0, "carpet", "doormat", shape="low"),
    _usual("cushion", 0.1, 1.6, "pillow"), _usual("curtain", 0.4, 8.0, "drape"), _usual("mirror", 0.08, 3.5),
    _usual("clock", 0.03, 3.5), _usual("picture", 0.05, 5.0, "painting", "poster", "photo frame"),
    _usual("book", 0.05, 0.6), _usual("box", 0.01, 4.0, "crate", "carton"), _usual("basket", 0.08, 1.5, "bin"),
    _usual("cup", 0.03, 0.3, "mug", "goblet", "tumbler"), _usual("bowl", 0.04, 0.8), _usual("plate", 0.05, 0.8, "dish"),
    _usual("bottle", 0.03, 1.0, "flask"), _usual("teapot", 0.05, 0.6, "kettle", "pitcher", "jug"),
    _usual("tea set", 0.1, 1.5), _usual("pot", 0.03, 1.5, "pan", "cauldron"),
    _usual("cutlery", 0.05, 0.6, "spoon", "fork", "knife"),
    _usual("fruit", 0.005, 0.6, "banana", "apple", "orange", "lemon", "pear", "avocado", "pomegranate", "strawberry"),
    _usual("ring", 0.008, 0.08), _usual("shoe", 0.05, 0.6, "boot", "sneaker"), _usual("bag", 0.05, 1.5, "backpack"),
    _usual("toy", 0.005, 2.0, "miniature", "dollhouse", "figurine", "teddy", "doll"), _usual("ball", 0.01, 1.2),
    _usual("television", 0.2, 3.0, "tv", "monitor", "screen"), _usual("laptop", 0.15, 0.7, "notebook"),
    _usual("phone", 0.05, 0.5, "telephone", "smartphone"), _usual("camera", 0.02, 0.8), _usual("radio", 0.05, 1.5),
    _usual("speaker", 0.03, 2.0), _usual("guitar", 0.3, 1.6), _usual("piano", 0.7, 3.5),
    _usual("fridge", 0.4, 2.5, "refrigerator", "freezer"), _usual("oven", 0.2, 2.5, "stove", "microwave", "cooker"),
    _usual("washer", 0.4, 2.0, "dishwasher", "washing machine", "dryer"), _usual("bathtub", 0.8, 3.0, "bath"),
    _usual("toilet", 0.3, 1.5), _usual("sink", 0.2, 2.5, "basin"), _usual("door", 0.5, 4.0, shape="tall"),
    _usual("ladder", 0.4, 8.0), _usual("statue", 0.03, 10.0, "bust", "sculpture", "dragon", "bunny"),
    _usual("helmet", 0.1, 0.8), _usual("car", 1.5, 7.0, "truck"), _usual("bicycle", 0.7, 2.5, "bike"),
)
TOYS = ("toy", "miniature", "dollhouse")
_BY_WORD = {word: usual for usual in USUAL for word in (usual.name, *usual.words)}
_LONGEST = max(len(phrase.split()) for phrase in _BY_WORD)
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


def words_of(text: str) -> list[str]:
    """The words of a name, in lower case: parted by case, digits and signs.

    >>> words_of("aws_KitchenTableA_01"), words_of("TVStand")
    (['aws', 'kitchen', 'table', 'a'], ['tv', 'stand'])
    """
    return [word.lower() for word in _WORD.findall(text)]


def usual_of(text: str) -> Usual | None:
    """The kind of thing that a name means: a toy wherever one of `TOYS` is in it, else the last word, or words, of the
    table; None where there is none.

    >>> usual_of("bedside table").name, usual_of("Chair cushions").name, usual_of("thing")
    ('nightstand', 'cushion', None)
    """
    words = words_of(text)
    if toy := next((_BY_WORD[word] for word in words if word in TOYS), None):
        return toy
    for end in range(len(words), 0, -1):
        for start in range(max(end - _LONGEST, 0), end):
            phrase = " ".join(words[start:end])
            if found := _BY_WORD.get(phrase) or _BY_WORD.get(phrase.removesuffix("s")):
                return found
    return None


@dataclass(frozen=True, kw_only=True)
class SizeAdvice:
    """What is odd about a size, and what to write."""

    rule: str
    """`expected a chair of 0.4 to 1.5 m, got one whose largest extent is 80 m`."""
    hint: str
    refused: bool
    """Whether it cannot be meant, being more than `BEYOND` times out of range."""
    scale: float | None = None
    """Metres per file unit that are proposed."""
    up: str = ""
    """Axis that is proposed to be up, perhaps."""


def size_advice(size: Lengths, *, category: str, suffix: str, scale: float, up: str) -> SizeAdvice | None:
    """What is to be said about an object with the extents `size` (width, depth, height; metres), read from a file
    with this `suffix` at `scale` metres per unit, its axis `up` being up; None where nothing is odd.

    The largest extent is compared with what is usual for `category`, or with `SENSE` where that says nothing.
    """
    usual, largest = usual_of(category), max(size)
    low, high = (usual.low, usual.high) if usual else SENSE
    if low <= largest <= high:
        return _up_advice(size, usual, up) if usual else None
    what = _called(usual)
    proposed = _scale(largest / scale, usual)
    unit = UNITS.get(proposed, "")
    hint = f"write `scale: {proposed:g}`, which makes it {length(largest / scale * proposed)}"
    hint += f"; the file is probably in {unit}" * bool(unit and unit != "metres")
    if own := OWN_UNIT.get(suffix.lower()):
        hint += f"; {own}, so what exported it was wrong"
    refused = not low / BEYOND <= largest <= high * BEYOND
    if largest < low / BEYOND:
        hint += f"; if it is meant, say so: `category: miniature {category or 'object'}`"
    return SizeAdvice(rule=f"expected {what} of {length(low)} to {length(high)}, got one whose largest extent is "
                      f"{length(largest)}", hint=hint, refused=refused, scale=proposed)


def _scale(units: float, usual: Usual | None) -> float:
    """The scale that makes something of so many file units most usual; one of `UNITS` where one of these will do."""
    low, high = (usual.low, usual.high) if usual else LIKELY
    middle = (low * high) ** 0.5
    fitting = [scale for scale in UNITS if low <= scale * units <= high]
    if fitting:
        return min(fitting, key=lambda scale: abs(log(scale * units / middle)))
    return float(f"{middle / units:.1g}")


def _up_advice(size: Lengths, usual: Usual, up: str) -> SizeAdvice | None:
    """Whether another axis may be up: of y and z the other one exchanges depth and height."""
    _, depth, height = size
    lies = usual.shape == "low" and depth == min(size) and height > LIES * depth
    stands = usual.shape == "tall" and height == min(size) and depth > STANDS * height
    other = {"y": "z", "z": "y"}.get(up)
    if not other or not (lies or stands):
        return None
    rule = (f"expected {_called(usual)} to be {'lower' if lies else 'higher'} than deep, got {length(height)} of "
            f"height and {length(depth)} of depth")
    return SizeAdvice(rule=rule, hint=f"perhaps it lies on its side: try `up: {other}`", refused=False, up=other)


def _called(usual: Usual | None) -> str:
    """The thing with its article."""
    name = usual.name if usual else "object"
    return f"{'an' if name[0] in 'aeiou' else 'a'} {name}"


def length(metres: float) -> str:
    """A length for people.

    >>> length(80), length(0.041), length(0.0008), length(2000)
    ('80 m', '4.1 cm', '0.8 mm', '2000 m')
    """
    for unit, factor in (("m", 1.0), ("cm", 100.0)):
        if metres * factor >= 1 or (unit == "m" and metres >= 0.2):
            return f"{_figures(metres * factor)} {unit}"
    return f"{_figures(metres * 1000)} mm"


def _figures(value: float) -> str:
    return f"{value:.0f}" if value >= 100 else f"{float(f'{value:.2g}'):g}"


def category_of(names: Iterable[str]) -> str:
    """The category that the first name tells of that tells of one; `object` where none does."""
    return next((usual.name for name in names if (usual := usual_of(name))), "object")
