"""Numbers for people."""

import pytest

from dataset_builder.report.looking.plain_numbers import metres, plain


@pytest.mark.parametrize(("value", "text"), [(1.544, "1.54"), (100.0, "100.00"), (0.0, "0"), (0.0016, "0.0016"),
                                             (0.00153, "0.0015"), (0.05, "0.05")])
def test_lengths_of_any_size_can_be_read(value: float, text: str) -> None:
    assert metres(value) == text


@pytest.mark.parametrize(("value", "text"), [(4500.0, "4500"), (7431.0, "7430"), (1.2e9, "1200000000"),
                                             (0.0371, "0.0371"), (0.2, "0.2"), (3.14159, "3.14")])
def test_no_number_is_a_power_of_ten(value: float, text: str) -> None:
    assert plain(value) == text
