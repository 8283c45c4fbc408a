"""Names with * and ?, as specs write them for things, lights and parts of a scene."""

from fnmatch import fnmatchcase


def fits(name: str, pattern: str) -> bool:
    """Whether a name fits a pattern: * is any text, slashes too, ? any character; all else is itself.

    >>> fits("Room/Chair[1]", "*/Chair[1]"), fits("Room/Chair", "*chair")
    (True, False)
    """
    return fnmatchcase(name, pattern.replace("[", "[[]"))
