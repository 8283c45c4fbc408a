"""Why drawn cameras will not do: what is said of them, and what to change."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Reason = Literal["room", "clearance", "coverage", "hidden"]
"""What a draw failed, as notes tell it."""
Cause = Literal[Reason, "close", "bounds", "cut"]
"""What to do something about: `close` is a clearance that the object itself is too small for, `bounds` one that is not
kept from what bounds the room, `cut` a frame that the object is too long for."""
_SAID: dict[Cause, str] = {
    "room": "outside the room at any coverage (distances needed: {low:.2f} to {high:.2f} m)",
    "clearance": "in a wall or too close to a surface (largest distance: {high:.2f} m)",
    "close": "closer than the clearance allows to the object or to what it stands on",
    "bounds": "closer than the clearance allows to walls, floor or ceiling",
    "coverage": "off in coverage (measured: {low:.3f} to {high:.3f})",
    "cut": "cut by the frame (best visibility: {high:.2f})",
    "hidden": "hidden or cut by the frame (best visibility: {high:.2f})",
}
_HINT: dict[Cause, str] = {
    "room": "widen `fov`, raise `coverage`, or make the room larger or the object smaller",
    "clearance": "lower `camera.clearance`, widen `azimuth` and `elevation`, or make the room larger",
    "close": "lower `camera.clearance`, or let the camera stand further away: lower `camera.coverage` or narrow `fov`",
    "bounds": "lower `camera.clearance`, make the room larger, or let the camera stand nearer: raise `coverage` or "
              "widen `fov`",
    "coverage": "widen `camera.coverage`",
    "cut": "lower both bounds of `camera.coverage`, or `camera.visibility`",
    "hidden": "lower `camera.visibility`, widen `azimuth` and `elevation`, or use less furniture",
}
_OF_FILES: dict[Cause, tuple[str, str]] = {
    "room": ("beyond walls, floors or the edge of the scene at any coverage (distances needed: {low:.2f} to {high:.2f} "
             "m)", "widen `fov`, raise `coverage`, or take a smaller object or another place for it"),
    "clearance": (_SAID["clearance"], "lower `camera.clearance`, widen `azimuth` and `elevation`, or `leave_out` what "
                                      "stands about the object"),
    "bounds": (_SAID["bounds"], "lower `camera.clearance`, or let the camera stand nearer: raise `coverage` or widen "
                                "`fov`"),
    "hidden": (_SAID["hidden"], "lower `camera.visibility`, widen `azimuth` and `elevation`, or `leave_out` what hides "
                                "the object"),
}
"""What is said and to be done where the space is not a room of ours, but what a file holds."""


@dataclass(frozen=True, kw_only=True)
class Miss:
    """Why a draw will not do, with the figure that failed."""

    reason: Reason
    figure: float
    cause: Cause


def noted(misses: Sequence[Miss]) -> str:
    """What failed how often, most often first."""
    return _counted([(miss.reason, miss.figure) for miss in misses], _SAID)[0]


def explained(misses: Sequence[Miss], noun: str = "room") -> tuple[str, str]:
    """Causes with their counts, most frequent first, and what to change about the first. noun: `room`, or `scene` for
    one from a file."""
    of_file = _OF_FILES if noun == "scene" else {}
    said, causes = _counted([(miss.cause, miss.figure) for miss in misses],
                            _SAID | {cause: words for cause, (words, _) in of_file.items()})
    hints = _HINT | {cause: hint for cause, (_, hint) in of_file.items()}
    return said, hints[causes[0]] if causes else ""


def told(miss: Miss, noun: str = "room") -> str:
    """What one camera that was not drawn fails, with its figure."""
    words = _OF_FILES[miss.cause][0] if noun == "scene" and miss.cause in _OF_FILES else _SAID[miss.cause]
    return re.sub(r"\{low\S+ to \{high[^}]+\}", "{high:.4g}", words).format(high=miss.figure)


def _counted(figures: Sequence[tuple[Cause, float]], words: dict[Cause, str]) -> tuple[str, list[Cause]]:
    """Each cause with its count and range in words, and the causes, most frequent first."""
    said, causes = list[str](), list[Cause]()
    for cause, count in Counter(each for each, _ in figures).most_common():
        own = [figure for each, figure in figures if each == cause]
        said.append(f"{count} {words[cause].format(low=min(own), high=max(own))}")
        causes.append(cause)
    return "; ".join(said), causes
