"""Digits, signs and errors as pages print them."""

from math import inf, nan

from dataset_builder.lightnet.results.clustered_means import ClusteredMean
from dataset_builder.report.page_parts import markdown_table, plus_minus, rounded


def made(mean: float, error: float) -> ClusteredMean:
    """An estimate of one example or of several."""
    return ClusteredMean(mean=mean, error=error, naive=nan, examples=2, objects=2, half_width=inf)


def test_decibels_have_two_digits_and_everything_else_four() -> None:
    assert (rounded(25.126, "psnr"), rounded(0.03456, "l1"), rounded(0.5, "lab", "+")) == ("25.13", "0.0346", "+0.5000")


def test_an_error_is_told_where_there_is_one() -> None:
    assert plus_minus(made(-1.5, 0.25), "psnr") == "-1.50 ± 0.25"
    assert plus_minus(made(1.5, 0.25), "psnr", "+") == "+1.50 ± 0.25"
    assert plus_minus(made(1.5, nan), "ssim") == "1.5000"


def test_bars_in_cells_do_not_end_them() -> None:
    assert markdown_table(["a", "b"], [["1", "x|y"]]) == "| a | b |\n| --- | --- |\n| 1 | x\\|y |"
