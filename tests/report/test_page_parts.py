"""Digits, signs and errors as pages print them, and the page of a study."""

from math import inf, nan

from dataset_builder.lightnet.results.clustered_means import ClusteredMean
from dataset_builder.report.page_parts import Section, markdown_table, page, plus_minus, rounded


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


def test_a_page_has_all_that_it_is_given_and_takes_none_of_it_as_html() -> None:
    sections = [Section(question="How <long>?", answer="12 s & more.", figure=b"PNG", head=("pass", "s"),
                        rows=[("i_t", "12.5"), ("<b>rough</b>", "3")]),
                Section(question="And?", answer="No table.")]
    found = page("A & B", ["First.", "Second."], sections, settings="--set a=b")
    for text in ("<h1>A &amp; B</h1>", "<p>First.</p>", "<p>Second.</p>", "<h2>How &lt;long&gt;?</h2>",
                 '<p class="answer">12 s &amp; more.</p>', 'src="data:image/png;base64,UE5H"',
                 "<th>pass</th><th>s</th>", "<td>i_t</td><td>12.5</td>", "<td>&lt;b&gt;rough&lt;/b&gt;</td>",
                 "<h2>And?</h2>",
                 "<pre>--set a=b</pre>"):
        assert found.count(text) == 1, text
    assert (found.count("<table>"), found.count("<img")) == (1, 1)
    assert "Recommended" not in page("A", [], [])
