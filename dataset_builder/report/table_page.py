"""A table of the paper as a page: measured rows beside published ones, their order, and the figure."""

from collections.abc import Sequence
from dataclasses import replace
from math import isfinite

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dataset_builder.errors import count_of
from dataset_builder.files import write_atomic
from dataset_builder.lightnet.data.truth import noise_unknown
from dataset_builder.lightnet.measures.metrics import METRICS, Metric
from dataset_builder.lightnet.results.clustered_means import ONE_OBJECT, ClusteredMean
from dataset_builder.lightnet.settings import differences
from dataset_builder.report.noise_lines import CEILING, NOISE, ceiling_line, with_interval
from dataset_builder.report.page_parts import COLOURS, heading, markdown_table, panels, plus_minus, png, rounded
from dataset_builder.shards.reader import load_manifest
from dataset_builder.studies.tables.paper import SOURCE, Printed, Table
from dataset_builder.studies.tables.result import Order, Pair, RowResult, orders, summary, verdict
from dataset_builder.studies.tables.table_study import TableStudy

HOW_TO_READ = """A pair is told apart where the interval of its difference, of 95% confidence and clustered by object,
does not contain 0; of pairs that are equal, one in twenty is still told apart. With one seed per row, intervals cover
other objects but not the spread between trainings; with several they cover both."""


def write_page(study: TableStudy, results: Sequence[RowResult]) -> None:
    """Write `table.md` and `table.png` in the study's folder. Raises OutputError."""
    unknown_noise = noise_unknown(load_manifest(study.dataset))
    write_atomic(study.out / "table.md", markdown(study.table, results, study.sentence, unknown_noise).encode())
    write_atomic(study.out / "table.png", png(table_figure(study.table, results, study.sentence)))


def table_figure(table: Table, results: Sequence[RowResult], settings: str) -> Figure:
    """A panel per metric: every row's mean with its standard error, and the printed number as a diamond."""
    figure, axes = panels(len(METRICS), f"{table.number}: {table.question}\n{settings}")
    figure.set_size_inches(figure.get_figwidth(), 1.9 + 0.34 * len(results))
    for metric, one in zip(METRICS, axes, strict=True):
        _means(one, results, metric)
        one.set(title=heading(metric), yticks=range(len(results)), yticklabels=[])
        one.invert_yaxis()
        one.locator_params(axis="x", nbins=5)
    axes[0].set_yticklabels([result.row.title + (" ‡" if result.altered else "") for result in results])
    axes[-1].legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.12))
    if any(result.altered for result in results):
        axes[0].set_xlabel("‡ run with losses off, see the table", fontsize=8, loc="left")
    return figure


def _means(axes: Axes, results: Sequence[RowResult], metric: Metric) -> None:
    means = [result.mean(metric.name) for result in results]
    axes.errorbar([found.mean for found in means], range(len(results)), linestyle="none", marker="o", markersize=5,
                  xerr=[found.error if isfinite(found.error) else 0.0 for found in means], capsize=3, color=COLOURS[0],
                  label="here, standard error over objects")
    if printed := {number: result.row.printed.of(metric.name) for number, result in enumerate(results)
                   if result.row.printed}:
        axes.plot(list(printed.values()), list(printed), linestyle="none", marker="D", markersize=6,
                  markerfacecolor="none", color=COLOURS[1], label="paper: another dataset and training")


def markdown(table: Table, results: Sequence[RowResult], settings: str, unknown_noise: str = "") -> str:
    """The measured rows beside the printed ones, what can be said of their order, and how to read it.

    unknown_noise: why nobody knows the noise of the truth; empty where it is known.
    """
    found = orders(table, results)
    first = results[0].mean("psnr")
    parts = [f"# {table.number}: {table.question}", settings, *(f"{one}." for one in cautions(results)),
             f"Means over {first.examples} held-out examples of {count_of(first.objects, 'object')}, on tone-mapped "
             f"values inside the mask; ± is the standard error, clustered by object. *Paper*: {SOURCE}, another "
             "dataset and other settings: compare the order, not the values.", _rows_table(results)]
    parts += _noise_parts(results, unknown_noise)
    parts += [f"Not measured: {title} ({reason}). The paper prints {_printed_text(numbers)}."
              for title, (numbers, reason) in table.absent.items()]
    parts += [f"Left out: {text}." for text in table.left_out]
    parts += ["## Against " + table.row(table.reference).title, _reference_table(table, results)]
    if found:
        parts += ["## The paper's order", verdict(found), HOW_TO_READ,
                  "\n".join(f"- {line}" for line in order_lines(found)), _pairs_table(table, found)]
    parts += ["## How the rows differ", f"From {table.row(table.reference).title}; everything else is the same.",
              _variants_table(table)]
    return "\n\n".join(parts) + "\n"


def cautions(results: Sequence[RowResult]) -> list[str]:
    """What is to be known before rows are compared."""
    return [ONE_OBJECT] * (results[0].mean("psnr").objects == 1)


def order_lines(found: Sequence[Order]) -> list[str]:
    """One sentence for each metric."""
    symbols = {metric.name: metric.symbol for metric in METRICS}
    return [summary(order, symbols[order.metric]) for order in found]


def row_line(result: RowResult) -> str:
    """A row for the terminal: measured figures, printed ones in brackets, and the note."""
    texts = [f"{metric.symbol} {plus_minus(result.mean(metric.name), metric.name)}"
             + (f" (paper {rounded(result.row.printed.of(metric.name), metric.name)})" if result.row.printed else "")
             + (f" ({rounded(result.mean(metric.name, 'corrected').mean, metric.name)} without noise)"
                if result.noise_known else "")
             for metric in METRICS]
    return f"{result.row.title}: {', '.join(texts)}" + (f" [{result.note}]" if result.note else "")


def _rows_table(results: Sequence[RowResult]) -> str:
    printed = ("paper",) if any(result.row.printed for result in results) else ()
    head = ["row", *(name for metric in METRICS for name in (f"{metric.symbol} {_arrow(metric)}", *printed)),
            "parameters", "s/step"]
    lines = []
    for result in results:
        cells = [f"{result.row.title} ({result.note})" if result.note else result.row.title]
        for metric in METRICS:
            cells.append(_measured_text(result, metric.name))
            if printed:
                cells.append(rounded(result.row.printed.of(metric.name), metric.name) if result.row.printed else "")
        parameters, seconds = result.facts.get("parameters"), result.facts.get("seconds_per_step")
        lines.append([*cells, f"{parameters:,}" if parameters else "", f"{seconds:.2f}" if seconds else ""])
    return markdown_table(head, lines)


def noise_line(results: Sequence[RowResult], unknown_noise: str) -> str:
    """What a perfect prediction would get, for the terminal."""
    return ceiling_line({metric.name: results[0].mean(metric.name, "ceiling") for metric in METRICS}, unknown_noise)


def _noise_parts(results: Sequence[RowResult], unknown_noise: str) -> list[str]:
    """Every row without the truth's noise, and what a perfect prediction would get."""
    if not results[0].noise_known:
        return [noise_line(results, unknown_noise)]
    head = ["row", *(f"{metric.symbol} {_arrow(metric)}" for metric in METRICS)]
    rows = [[f"{result.row.title}, without noise",
             *(with_interval(result.mean(metric.name, "corrected"), metric.name) for metric in METRICS)]
            for result in results]
    ceiling = [f"*{CEILING}*", *(plus_minus(results[0].mean(metric.name, "ceiling"), metric.name)
                                 for metric in METRICS)]
    return ["## Noise of the truth", " ".join(NOISE.split()), markdown_table(head, [*rows, ceiling])]


def _reference_table(table: Table, results: Sequence[RowResult]) -> str:
    """Every row less the reference, example by example."""
    reference = next(result for result in results if result.row.name == table.reference)
    others = [result for result in results if result is not reference]
    return markdown_table(["row", *(f"{metric.symbol} {_arrow(metric)}" for metric in METRICS)], [
        [result.row.title, *(_difference_text(result.less(reference, metric.name), metric) for metric in METRICS)]
        for result in others])


def _pairs_table(table: Table, found: Sequence[Order]) -> str:
    """A line for every two rows that are compared, as PSNR is printed: how much better the first is, by metric."""
    titles = {row.name: row.title for row in table.rows}
    by_pair: dict[tuple[str, frozenset[str]], dict[str, Pair]] = {}
    for order in found:
        for pair in order.pairs:
            by_pair.setdefault((pair.group, frozenset((pair.better, pair.worse))), {})[order.metric] = pair
    rows = []
    for (group, _), pairs in by_pair.items():
        lead = pairs.get("psnr") or next(iter(pairs.values()))
        rows.append([group, titles[lead.better], titles[lead.worse],
                     *(_pair_text(pairs.get(metric.name), lead.better) for metric in METRICS)])
    return markdown_table(["compared", "row", "against", *(metric.symbol for metric in METRICS)], rows)


def _pair_text(pair: Pair | None, first: str) -> str:
    """Printed gain and measured gain of the row `first` over the other one of a pair."""
    if pair is None:
        return "printed as equal"
    sign = 1 if pair.better == first else -1
    here = replace(pair.gain, mean=sign * pair.gain.mean)
    return f"paper {sign * pair.printed:+.3g}, here {_small(here)}: {pair.verdict}"


def _variants_table(table: Table) -> str:
    """In what the rows' configurations differ from that of the reference."""
    reference = table.row(table.reference)
    rows = []
    for row in table.rows:
        if row.spec and reference.spec and row is not reference:
            changes = differences(reference.spec, row.spec).items()
            rows.append([row.title, ", ".join(f"`{key}`: {there} instead of {here}" for key, (here, there) in changes)])
    return markdown_table(["row", "differs in"], rows)


def _measured_text(result: RowResult, metric: str) -> str:
    spread = result.spread(metric)
    text = plus_minus(result.mean(metric), metric)
    return f"{text} (sd over seeds {rounded(spread, metric)})" if isfinite(spread) else text


def _difference_text(difference: ClusteredMean, metric: Metric) -> str:
    text = _small(difference)
    if not difference.told_apart:
        return f"{text}, open"
    return f"{text}, {'better' if (difference.mean > 0) == (metric.better == 'high') else 'worse'}"


def _small(difference: ClusteredMean) -> str:
    """A difference, which may be far smaller than the figures that it is of."""
    error = f" ± {difference.error:.2g}" if isfinite(difference.error) else ""
    return f"{difference.mean:+.3g}{error}"


def _printed_text(numbers: Printed) -> str:
    return ", ".join(f"{metric.symbol} {rounded(numbers.of(metric.name), metric.name)}" for metric in METRICS)


def _arrow(metric: Metric) -> str:
    return "↓" if metric.better == "low" else "↑"
