"""Names with * and ?, as specs write them for things, lights and parts of a scene."""

from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase


def fits(name: str, pattern: str) -> bool:
    """Whether a name fits a pattern: * is any text, slashes too, ? any character; all else is itself.

    >>> fits("Room/Chair[1]", "*/Chair[1]"), fits("Room/Chair", "*chair")
    (True, False)
    """
    return fnmatchcase(name, pattern.replace("[", "[[]"))


def unmatched(patterns: Iterable[str], names: Sequence[str]) -> list[str]:
    """The patterns that no name fits, each once."""
    return [pattern for pattern in dict.fromkeys(patterns) if not any(fits(name, pattern) for name in names)]
