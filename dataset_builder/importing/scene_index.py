"""What is kept of a 3D-FRONT scene once it was read: a line of the index, a few kilobytes for its megabytes."""

import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from typing import Any

from dataset_builder.assets.scene_readers.front3d_values import SceneFault

LEAST_AREA = 4.0
"""m^2; a camera and a target need room."""
BROKEN, NO_FLOOR, SMALL, EMPTY, UNPUBLISHED = ("cannot be read", "no floor", f"less than {LEAST_AREA:g} m^2",
                                               "no furniture", "no furniture with a model")
"""Why a room, or a scene, is not usable."""


@dataclass(frozen=True, kw_only=True, slots=True)
class FurniturePiece:
    """A piece of furniture where it stands."""

    jid: str
    """Its model of 3D-FUTURE."""
    category: str = ""
    """As the scene file has it."""
    valid: bool = True
    """Whether the scene file says that its model is published."""
    bottom: float = 0.0
    """Height of its origin, which models have at their bottom, metres."""
    sizes: tuple[tuple[float, ...], ...] = ()
    """What the scene file declares of its model, the order of sides varies; metres, as a rule."""


@dataclass(frozen=True, kw_only=True, slots=True)
class RoomIndex:
    """A room of a scene."""

    name: str
    """Its `instanceid`, such as `Kitchen-1224`."""
    kind: str
    """Its type, such as `Kitchen`."""
    area: float
    """Of its floors, m^2; 0 for none."""
    pieces: tuple[FurniturePiece, ...] = ()

    def unusable(self, models: Mapping[str, Any]) -> str:
        """Why no target can be rendered here, given the models that there are; "" where one can."""
        if self.area <= 0:
            return NO_FLOOR
        if self.area < LEAST_AREA:
            return SMALL
        if not self.pieces:
            return EMPTY
        return "" if any(piece.valid and piece.jid in models for piece in self.pieces) else UNPUBLISHED


@dataclass(frozen=True, kw_only=True, slots=True)
class SceneIndex:
    """A scene of a folder."""

    file: str
    """Name of the file."""
    sha256: str
    """Of the file; empty where it cannot be opened."""
    size: int
    """Of the file, bytes."""
    uid: str = ""
    rooms: tuple[RoomIndex, ...] = ()
    faults: Mapping[str, int] = field(default_factory=dict)
    """How often each kind of fault was found."""
    broken: str = ""
    """Why it cannot be read; empty where it can."""

    def usable(self, models: Mapping[str, Any]) -> list[RoomIndex]:
        """Rooms that a target can be rendered in, given the models that there are."""
        return [room for room in self.rooms if not room.unusable(models)]

    def unusable(self, models: Mapping[str, Any]) -> str:
        """Why the scene is of no use; "" where one of its rooms is. Of its rooms the reason that stands last, that is
        what the best of them lacks."""
        if self.broken:
            return BROKEN
        order = (NO_FLOOR, SMALL, EMPTY, UNPUBLISHED, "")
        return max((room.unusable(models) for room in self.rooms), key=order.index, default=NO_FLOOR)

    def jids(self, models: Mapping[str, Any]) -> Iterator[str]:
        """Models that stand in it and are there, each as often as it stands; in rooms that are of no use, too."""
        return (piece.jid for room in self.rooms for piece in room.pieces if piece.valid and piece.jid in models)

    def missing(self, models: Mapping[str, Any]) -> list[str]:
        """Models that it says are published and that are not there, each once."""
        pieces = (piece for room in self.rooms for piece in room.pieces)
        return sorted({piece.jid for piece in pieces if piece.valid and piece.jid not in models})


def index_line(scene: SceneIndex, faults: tuple[SceneFault, ...] = ()) -> str:
    """A scene with its faults as a line of JSON, without the end of the line."""
    plain = {**asdict(scene), "told": [(fault.kind, fault.where, fault.said) for fault in faults]}
    return json.dumps(plain, ensure_ascii=True, separators=(",", ":"))


def scene_of_line(line: str) -> tuple[SceneIndex, tuple[SceneFault, ...]]:
    """What `index_line` made a line of. Raises ValueError where it is none, such as one that was cut off."""
    try:
        data = json.loads(line)
        told = tuple(SceneFault(kind, where, said) for kind, where, said in data.pop("told"))
        rooms = tuple(_room(room) for room in data.pop("rooms"))
        return SceneIndex(rooms=rooms, **data), told
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise ValueError("no line of an index") from error


def _room(data: dict[str, Any]) -> RoomIndex:
    pieces = tuple(_piece(**{**piece, "sizes": tuple(map(tuple, piece["sizes"]))}) for piece in data.pop("pieces"))
    return RoomIndex(pieces=pieces, **data)


@lru_cache(maxsize=2**16)
def _piece(*, jid: str, category: str, **rest: Any) -> FurniturePiece:
    """One object for all pieces that are the same: thousands of scenes share a few thousand models."""
    return FurniturePiece(jid=sys.intern(jid), category=sys.intern(category), **rest)
