"""The families of embedded furniture: what each is and which parameters a spec may set. One table, read by all."""

from dataclasses import dataclass, replace
from functools import partial

from dataset_builder.spec.numbers import AnyNumber, Choice, Uniform


@dataclass(frozen=True, kw_only=True)
class FamilyParam:
    """One parameter of a family."""

    name: str
    unit: str
    low: float
    """Least value that is allowed, in `unit`."""
    high: float
    """Largest value that is allowed, in `unit`."""
    default: AnyNumber
    """What is drawn from when the spec says nothing."""
    integer: bool
    meaning: str


@dataclass(frozen=True, kw_only=True)
class Family:
    """One kind of furniture, made in code from its parameters and a seed."""

    name: str
    category: str
    summary: str
    params: tuple[FamilyParam, ...]

    def param(self, name: str) -> FamilyParam:
        """The parameter of that name. Raises KeyError where the family has none."""
        for param in self.params:
            if param.name == name:
                return param
        raise KeyError(name)


def _drawn(unit: str, name: str, low: float, high: float, usual: tuple[float, float], meaning: str) -> FamilyParam:
    return FamilyParam(name=name, unit=unit, low=low, high=high, default=Uniform(uniform=usual), integer=False,
                       meaning=meaning)


_length, _angle, _share = partial(_drawn, "m"), partial(_drawn, "degree"), partial(_drawn, "1")


def _count(name: str, low: int, high: int, meaning: str) -> FamilyParam:
    values = tuple(float(value) for value in range(low, high + 1))
    return FamilyParam(name=name, unit="", low=low, high=high, default=Choice(choice=values), integer=True,
                       meaning=meaning)


def _style(name: str, *meanings: str) -> FamilyParam:
    return _count(name, 0, len(meanings) - 1, ", ".join(f"{index} {meaning}" for index, meaning in enumerate(meanings)))


def _finish(*meanings: str) -> FamilyParam:
    """A choice of what the thing is made of, the first unless a spec says otherwise."""
    return replace(_style("finish", *meanings), default=0.0)


BEVEL = _length("bevel", 0.001, 0.008, (0.002, 0.005), "width of the chamfer on every hard edge")

_SEATS = (
    Family(name="chair", category="chair", summary="dining chair with four legs and a back", params=(
        _length("width", 0.38, 0.60, (0.42, 0.50), "across the seat"),
        _length("depth", 0.38, 0.60, (0.42, 0.50), "of the seat"),
        _length("seat_height", 0.40, 0.52, (0.43, 0.47), "top of the seat board"),
        _length("back_height", 0.72, 1.15, (0.80, 1.00), "top of the back"),
        _length("leg", 0.026, 0.05, (0.030, 0.042), "thickness of legs and posts"),
        _angle("recline", 0, 16, (5, 12), "of the back from upright"),
        _style("back", "upright slats", "ladder", "padded panel", "solid board"),
        _style("seat", "bare board", "cushion"), BEVEL)),
    Family(name="armchair", category="armchair", summary="upholstered chair with arms", params=(
        _length("width", 0.65, 1.10, (0.74, 0.92), "over the arms"),
        _length("depth", 0.65, 1.05, (0.75, 0.90), "front to back"),
        _length("seat_height", 0.36, 0.50, (0.40, 0.46), "top of the seat cushion"),
        _length("back_height", 0.68, 1.10, (0.78, 0.98), "top of the back"),
        _length("arm_width", 0.05, 0.20, (0.08, 0.16), "of one arm"),
        _angle("recline", 0, 15, (5, 11), "of the back from upright"),
        _style("arms", "blocks", "rolls", "wooden frame"), BEVEL)),
    Family(name="sofa", category="sofa", summary="two to four seats with arms and cushions", params=(
        _length("width", 1.40, 3.00, (1.70, 2.40), "over the arms"),
        _length("depth", 0.70, 1.10, (0.80, 0.95), "front to back"),
        _length("seat_height", 0.36, 0.50, (0.40, 0.46), "top of the seat cushions"),
        _length("back_height", 0.66, 1.05, (0.74, 0.90), "top of the back"),
        _length("arm_width", 0.05, 0.25, (0.10, 0.20), "of one arm"),
        _angle("recline", 0, 15, (5, 11), "of the back from upright"),
        _style("arms", "blocks", "rolls", "wooden frame"),
        _count("seats", 2, 4, "seat cushions"),
        _count("pillows", 0, 2, "loose pillows"), BEVEL)),
    Family(name="stool", category="stool", summary="round or square seat on four legs", params=(
        _length("width", 0.28, 0.45, (0.31, 0.38), "across the seat"),
        _length("height", 0.40, 0.82, (0.44, 0.68), "top of the seat"),
        _length("leg", 0.022, 0.045, (0.026, 0.036), "diameter of a leg"),
        _length("splay", 0.0, 0.07, (0.02, 0.05), "how far each leg leans outwards"),
        _style("shape", "round", "square"),
        _style("seat", "bare board", "cushion"), BEVEL)),
    Family(name="bench", category="bench", summary="long seat without a back", params=(
        _length("width", 0.80, 1.80, (1.00, 1.50), "long side"),
        _length("depth", 0.30, 0.50, (0.34, 0.44), "short side"),
        _length("height", 0.38, 0.52, (0.42, 0.48), "top of the seat"),
        _length("leg", 0.035, 0.07, (0.042, 0.06), "thickness of a leg"),
        _style("seat", "slats", "padded"), BEVEL)),
    Family(name="ottoman", category="ottoman", summary="soft footstool", params=(
        _length("width", 0.40, 0.90, (0.48, 0.70), "across"),
        _length("depth", 0.40, 0.70, (0.45, 0.60), "front to back of the square one"),
        _length("height", 0.32, 0.50, (0.36, 0.44), "top of the cushion"),
        _style("shape", "round", "square"), BEVEL)),
)

_TABLES = (
    Family(name="dining_table", category="table", summary="table to sit at", params=(
        _length("width", 0.80, 2.60, (1.20, 2.00), "long side, or diameter of a round top (at most 1.4)"),
        _length("depth", 0.65, 1.20, (0.75, 0.95), "short side of a rectangular top"),
        _length("height", 0.68, 0.80, (0.72, 0.76), "top of the board"),
        _length("thickness", 0.018, 0.06, (0.022, 0.045), "of the board"),
        _length("leg", 0.04, 0.10, (0.05, 0.08), "thickness of a leg at its top"),
        _style("shape", "rectangular", "round"),
        _style("base", "square tapered legs", "splayed round legs", "pedestal or trestles"), BEVEL)),
    Family(name="coffee_table", category="table", summary="low table for a sitting room", params=(
        _length("width", 0.55, 1.50, (0.75, 1.20), "long side, or diameter of a round top (at most 1.1)"),
        _length("depth", 0.40, 0.90, (0.50, 0.70), "short side of a rectangular top"),
        _length("height", 0.28, 0.52, (0.34, 0.45), "top of the board"),
        _length("thickness", 0.015, 0.05, (0.018, 0.035), "of the board"),
        _length("leg", 0.022, 0.06, (0.026, 0.045), "thickness of a leg"),
        _style("shape", "rectangular", "round"),
        _style("shelf", "none", "one below"),
        _count("books", 0, 3, "books lying on it"), BEVEL)),
    Family(name="desk", category="desk", summary="writing desk with a chest of drawers", params=(
        _length("width", 0.95, 1.90, (1.15, 1.60), "long side"),
        _length("depth", 0.50, 0.85, (0.58, 0.72), "short side"),
        _length("height", 0.68, 0.80, (0.72, 0.76), "top of the board"),
        _length("thickness", 0.018, 0.05, (0.022, 0.035), "of the board"),
        _count("drawers", 1, 4, "drawers in the chest"),
        _style("side", "chest left", "chest right"),
        _style("handle", "bar", "knob"), BEVEL)),
)

_STORAGE = (
    Family(name="cabinet", category="cabinet", summary="sideboard with doors and drawers", params=(
        _length("width", 0.70, 2.20, (0.90, 1.70), "side to side"),
        _length("depth", 0.32, 0.60, (0.38, 0.48), "front to back"),
        _length("height", 0.55, 1.25, (0.65, 0.95), "floor to top"),
        _length("leg_height", 0.04, 0.22, (0.08, 0.18), "floor to carcass"),
        _count("bays", 1, 4, "side by side"),
        _style("front", "flat", "framed"),
        _style("handle", "bar", "knob"),
        _count("drawers", 0, 3, "drawers of the bays that have no door"), _finish("wood or paint", "lacquer"), BEVEL)),
    Family(name="bookshelf", category="bookshelf", summary="open shelves with some books", params=(
        _length("width", 0.50, 1.40, (0.65, 1.10), "side to side"),
        _length("depth", 0.22, 0.42, (0.26, 0.34), "front to back"),
        _length("height", 0.75, 2.30, (1.20, 2.00), "floor to top"),
        _length("board", 0.015, 0.035, (0.018, 0.028), "thickness of boards"),
        _count("shelves", 2, 6, "compartments above each other"),
        _share("fill", 0, 1, (0.3, 0.8), "share of the shelves' length that books take"), BEVEL)),
    Family(name="wardrobe", category="wardrobe", summary="tall cupboard with doors", params=(
        _length("width", 0.70, 2.20, (0.90, 1.70), "side to side"),
        _length("depth", 0.45, 0.70, (0.52, 0.62), "front to back"),
        _length("height", 1.60, 2.40, (1.85, 2.15), "floor to top"),
        _count("doors", 1, 4, "side by side"),
        _style("front", "flat", "framed"),
        _style("handle", "bar", "knob"),
        _style("drawer", "none", "one row below the doors"), BEVEL)),
    Family(name="nightstand", category="nightstand", summary="small chest beside a bed", params=(
        _length("width", 0.32, 0.65, (0.38, 0.52), "side to side"),
        _length("depth", 0.30, 0.52, (0.34, 0.44), "front to back"),
        _length("height", 0.40, 0.72, (0.46, 0.60), "floor to top"),
        _count("drawers", 1, 3, "drawers"),
        _style("base", "legs", "plinth"),
        _style("handle", "bar", "knob"),
        _count("books", 0, 3, "books lying on it"), BEVEL)),
)

_OTHERS = (
    Family(name="bed", category="bed", summary="bed with mattress, pillows and blanket", params=(
        _length("width", 0.80, 2.00, (0.90, 1.80), "of the mattress"),
        _length("length", 1.80, 2.20, (1.95, 2.10), "of the mattress"),
        _length("height", 0.36, 0.65, (0.44, 0.56), "top of the mattress"),
        _length("head_height", 0.75, 1.40, (0.85, 1.15), "top of the headboard"),
        _style("head", "solid board", "slats", "padded panel"),
        _share("cover", 0.35, 0.7, (0.5, 0.7), "share of the length under the blanket"), BEVEL)),
    Family(name="floor_lamp", category="lamp", summary="standing lamp with a shade (it gives no light)", params=(
        _length("height", 1.20, 2.00, (1.45, 1.75), "floor to the top of the shade"),
        _length("shade_width", 0.25, 0.60, (0.34, 0.50), "diameter of the shade below"),
        _length("shade_height", 0.16, 0.40, (0.22, 0.32), "of the shade"),
        _share("taper", 0.4, 1.0, (0.6, 1.0), "diameter of the shade above over that below"),
        _length("pole", 0.010, 0.03, (0.014, 0.022), "diameter of the pole"),
        _style("base", "disc", "tripod"), BEVEL)),
    Family(name="vase", category="vase", summary="turned floor vase", params=(
        _length("height", 0.25, 0.90, (0.35, 0.65), "floor to rim"),
        _length("belly", 0.14, 0.45, (0.20, 0.32), "largest diameter"),
        _length("neck", 0.05, 0.13, (0.07, 0.11), "smallest diameter of the neck"),
        _share("belly_at", 0.25, 0.65, (0.32, 0.58), "height of the belly over the height"),
        _finish("ceramic or stone", "glass"))),
    Family(name="plant", category="plant", summary="pot with sword-shaped leaves", params=(
        _length("pot_width", 0.18, 0.50, (0.24, 0.38), "diameter of the pot's rim"),
        _length("pot_height", 0.16, 0.50, (0.22, 0.36), "of the pot"),
        _length("leaf_length", 0.25, 1.10, (0.40, 0.85), "of the longest leaf"),
        _count("leaves", 5, 14, "leaves"))),
)

FAMILIES: dict[str, Family] = {family.name: family for family in (*_SEATS, *_TABLES, *_STORAGE, *_OTHERS)}
"""Every embedded family by name."""
