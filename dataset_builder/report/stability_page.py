"""The paper's table of stability as a page: means and deviations over views, printed ones beside measured ones."""

from math import isfinite
from pathlib import Path

from dataset_builder.files import write_atomic
from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.lightnet.results.sequences import TRUTH
from dataset_builder.lightnet.results.spreads import FLICKERS, SequenceScores, Spread, Steadiness
from dataset_builder.report.page_parts import heading, markdown_table, rounded
from dataset_builder.report.sequence_page import MEANING, spread_text
from dataset_builder.studies.tables.paper import SOURCE, STABILITY, STABILITY_DEVIATIONS
from dataset_builder.studies.tables.table_study import TableStudy

PAGE = "stability.md"
RIVAL, OWN = "pix2pix", "lightnet"


def write_stability(study: TableStudy, found: SequenceScores) -> Path:
    """Write `stability.md` in the study's folder; its path. Raises OutputError."""
    path = study.out / PAGE
    write_atomic(path, markdown(study, found).encode())
    return path


def markdown(study: TableStudy, found: SequenceScores) -> str:
    """Rows of the table as columns, printed figures before measured ones, and what can be said of deviations."""
    titles = {row.name: row.title for row in study.table.rows} | {TRUTH: TRUTH}
    head, columns = ["figure"], list[tuple[Steadiness, bool]]()
    for row in found.whole:
        printed = row.method in STABILITY
        head += [f"{titles[row.method]}, paper"] * printed + [titles[row.method]]
        columns += [(row, True)] * printed + [(row, False)]
    body = [[heading(metric), *(_printed(row.method, metric.name) if printed else
                                _text(row.metrics.get(metric.name), metric.name) for row, printed in columns)]
            for metric in METRICS]
    body += [[title, *("" if printed else _text(row.flickers[name], name) for row, printed in columns)]
             for name, title in FLICKERS.items()]
    return "\n\n".join([
        f"# {study.table.number}: {study.table.question}", study.sentence,
        f"{found.extent} of {found.dataset}, split {found.split}, by the trainings of seed {study.base.seed}. *Paper*: "
        f"{SOURCE}, 600 views, another dataset and other settings: compare the order, not the values.",
        markdown_table(head, body), " ".join(MEANING.split()), "## Deviations",
        "The paper finds LighTNet better in all means, but its L1 and PSNR vary more from view to view than those of "
        "Pix2Pix, whose light is always weak.", "\n".join(f"- {line}" for line in deviation_lines(found)),
        "The trainings themselves, and which differences are told apart: `table.md`."]) + "\n"


def deviation_lines(found: SequenceScores) -> list[str]:
    """For each metric how much LighTNet varies over views beside Pix2Pix, in the paper and here."""
    rows = {row.method: row for row in found.whole}
    lines = []
    for metric in METRICS:
        printed = STABILITY_DEVIATIONS[OWN].of(metric.name) / STABILITY_DEVIATIONS[RIVAL].of(metric.name)
        own, rival = (rows[name].metrics[metric.name].deviation for name in (OWN, RIVAL))
        here = f"{own / rival:.2f} times here" if isfinite(own) and rival > 0 else "not known here"
        lines.append(f"{metric.symbol}: LighTNet's deviation over views is {printed:.2f} times Pix2Pix's in the paper, "
                     f"{here}")
    return lines


def _printed(row: str, metric: str) -> str:
    mean, deviation = (rounded(part[row].of(metric), metric) for part in (STABILITY, STABILITY_DEVIATIONS))
    return f"{mean} ± {deviation}"


def _text(found: Spread | None, name: str) -> str:
    return spread_text(found, name) if found is not None and found.count else ""
