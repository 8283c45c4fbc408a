"""Colours as written: three linear factors, each a number or a distribution, or sRGB as hexadecimal digits."""

import re
from typing import Annotated, Any

from pydantic import BeforeValidator

from dataset_builder.spec.numbers import within

_DIGITS = re.compile(r"#([0-9a-fA-F]{2})([0-9a-fA-F]{2})([0-9a-fA-F]{2})")


def _linear(value: Any) -> Any:
    """Linear Rec.709 of `#rrggbb` (IEC 61966-2-1); anything else as it is. Raises ValueError for other text.

    >>> _linear("#ff0000")
    (1.0, 0.0, 0.0)
    """
    if value is None:
        raise ValueError("expected three numbers or '#' and six hexadecimal digits, got nothing: without quotes, YAML "
                         "takes # for the beginning of a comment")
    if not isinstance(value, str):
        return value
    if (found := _DIGITS.fullmatch(value)) is None:
        raise ValueError(f"expected three numbers or '#' and six hexadecimal digits, in quotes, got {value!r}")
    coded = [int(digits, 16) / 255 for digits in found.groups()]
    return tuple(part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in coded)


_Factor = within(low=0, high=1)
_Factors = tuple[_Factor, _Factor, _Factor]  # type: ignore[valid-type]
MaybeColour = Annotated[_Factors | None, BeforeValidator(_linear, json_schema_input_type=_Factors | str)]
"""Three factors in [0, 1], linear Rec.709. The key may be left out, but where it is written, it says something."""
