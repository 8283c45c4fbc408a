"""Studies as one page of HTML: question, figure, answer. Nothing is loaded from elsewhere: figures are in the page."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from dataset_builder.files import write_atomic

STYLE = """body { font: 16px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 2rem auto; padding: 0 1rem;
  color: #202020 }
h1 { line-height: 1.2 } h2 { margin: 2.5rem 0 .5rem; font-size: 1.2rem }
img { max-width: 100%; height: auto } pre { background: #f4f4f4; padding: .8rem; overflow-x: auto }
table { border-collapse: collapse; font-size: .85rem } th, td { padding: .2rem .7rem; border-bottom: 1px solid #ddd }
td { font-variant-numeric: tabular-nums } th { text-align: left } .answer { font-weight: 600 }"""


@dataclass(frozen=True, kw_only=True)
class Section:
    """One question."""

    question: str
    answer: str
    figure: bytes = b""
    """Bytes of a PNG, or none."""
    head: Sequence[str] = ()
    """Of a table, or none."""
    rows: Sequence[Sequence[str]] = ()


def write_study(folder: Path, title: str, lead: Sequence[str], sections: Sequence[Section], *,
                figures: Mapping[str, bytes], settings: str = "") -> None:
    """Write `report.html` into a study's folder, and the PNG `figures` by name, also beside it. Raises OutputError."""
    for name, figure in figures.items():
        write_atomic(folder / "figures" / f"{name}.png", figure)
    write_atomic(folder / "report.html", page(title, lead, sections, settings).encode())


def page(title: str, lead: Sequence[str], sections: Sequence[Section], settings: str = "") -> str:
    """The page. lead: paragraphs on top; settings: lines to be copied, at the end."""
    parts = [f"<h1>{escape(title)}</h1>", *(f"<p>{escape(text)}</p>" for text in lead),
             *(_section(section) for section in sections)]
    if settings:
        parts.append("<h2>Recommended settings</h2><p>Options of <code>dataset-builder build</code>, also in "
                     f"<code>recommended.txt</code>:</p><pre>{escape(settings)}</pre>")
    return (f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
            f"<style>{STYLE}</style></head>\n<body>\n" + "\n".join(parts) + "\n</body></html>\n")


def _section(section: Section) -> str:
    parts = [f"<h2>{escape(section.question)}</h2>"]
    if section.figure:
        data = b64encode(section.figure).decode()
        parts.append(f'<p><img alt="{escape(section.question)}" src="data:image/png;base64,{data}"></p>')
    parts.append(f'<p class="answer">{escape(section.answer)}</p>')
    if section.rows:
        head = "".join(f"<th>{escape(name)}</th>" for name in section.head)
        body = "".join("<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>" for row in section.rows)
        parts.append(f"<table><tr>{head}</tr>{body}</table>")
    return "\n".join(parts)
