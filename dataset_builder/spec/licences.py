"""Licences of objects, and the one that a dataset of them may have."""

import re
from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

Licence = Annotated[str, Field(pattern=r"^[A-Za-z0-9.+-]*$", max_length=100)]
FREE = "CC0-1.0"
"""What embedded furniture is under."""
KNOWN = (FREE, "CC-BY-4.0", "CC-BY-SA-4.0", "CC-BY-NC-4.0", "CC-BY-NC-SA-4.0")
"""Those whose conditions are compared; of the others a spec must say what follows."""
_COMMONS = re.compile(r"CC-BY(-NC)?(-SA)?-[1-4]\.[05]")
_ASKS = {"BY": "attribution", "NC": "no commercial use", "SA": "the same licence"}


def conditions(licence: str) -> frozenset[str] | None:
    """What a licence asks of what is made from it: some of `BY`, `NC` and `SA`; None where that is not known.

    >>> sorted(conditions("CC-BY-NC-4.0")), conditions("CC0-1.0"), conditions("MIT")
    (['BY', 'NC'], frozenset(), None)
    """
    if licence == FREE:
        return frozenset()
    found = _COMMONS.fullmatch(licence)
    return frozenset(("BY", *(part[1:] for part in found.groups() if part))) if found else None


def licence_of(parts: Mapping[str, str]) -> tuple[str, str]:
    """The licence that follows from those of the parts, by name, and "", or "" and why none does."""
    for name, licence in parts.items():
        if conditions(licence) is None:
            return "", f"the conditions of {licence} ({name}) are not known here"
    asked = frozenset[str]().union(*(conditions(licence) or () for licence in parts.values()))
    found = next(one for one in KNOWN if conditions(one) == (asked or frozenset()))
    return (found, "") if not (why := contradiction(found, parts)) else ("", why)


def contradiction(licence: str, parts: Mapping[str, str]) -> str:
    """Why a dataset of these parts may not be under `licence`; "" where nothing known speaks against it.

    Every condition must be kept, and `SA` allows no others. Where conditions are not known, the spec's word is taken,
    but nothing takes the place of `SA`.
    """
    kept = conditions(licence)
    for name, own in parts.items():
        asked = conditions(own) or frozenset()
        lost = asked - kept if kept is not None else asked & {"SA"}
        if lost:
            return f"{own} ({name}) asks for {_ASKS[min(lost)]}"
        if "SA" in asked and kept != asked:
            return f"{own} ({name}) asks for the same licence"
    return ""
