"""Make the measured parts of `docs/accuracy.md` anew, tables, figures and sentences, from the files of a study.

Without a folder, from what the page was made of last. `make docs-accuracy` runs the study first.
"""

import argparse
import re
import sys
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from textwrap import fill

from PIL import Image
from PIL.PngImagePlugin import PngInfo

from dataset_builder.files import write_atomic
from dataset_builder.report.accuracy_answers import (
    Table,
    answer_table,
    asked_sentence,
    gpu_sentence,
    law_table,
    spread_table,
    trust_sentences,
)
from dataset_builder.report.accuracy_page import all_figures
from dataset_builder.report.page_parts import markdown_table
from dataset_builder.studies.accuracy.bounds import DEPTH, EDGES, TEXTURES
from dataset_builder.studies.accuracy.conclusions import ANSWER, Conclusions, read_conclusions
from dataset_builder.studies.accuracy.precision import ACCUMULATION, CODECS
from dataset_builder.studies.accuracy.rows import ADAPTIVE, DENOISED, UNIFORM, read_table

ROOT = Path(__file__).resolve().parent.parent
PAGE, KEPT = ROOT / "docs" / "accuracy.md", ROOT / "docs" / "images" / "accuracy"
SPEC = ROOT / "scene_specs" / "3df-lighting-mini.yaml"
TABLE, STAMP = "table.csv", "table"
"""The rows, and what the digest of their file is called in the PNG files."""
SHOWN = {"laws": "Error against samples per pixel, with the law of every example",
         "spread": "Share of the examples below an error", "adaptive": "Adaptive sampling against uniform spp",
         "uniform-denoised": "Error against seconds, denoised", "depth": "Bias against path depth",
         "texture-size": "Error of d and i_t against texture size",
         "codecs": "Bytes, write and read times of lossless codecs"}
COLOURS, WIDTH = 64, 130
"""Colours that a figure keeps, characters of a line."""
MARK = re.compile(r"(<!-- made: ([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def main(arguments: list[str]) -> int:
    """Take a study's files over, then write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("study", type=Path, nargs="?", help="folder of a finished study of the mini dataset")
    study = parser.parse_args(arguments).study
    if study:
        write_atomic(KEPT / TABLE, (study / "results.csv").read_bytes())
        write_atomic(KEPT / ANSWER, (study / ANSWER).read_bytes())
    found = conclusions()
    for name, figure in all_figures(found).items():
        if name in SHOWN:
            write_atomic(KEPT / f"{name}.png", stamped(figure))
    write_atomic(PAGE, made(PAGE.read_text(encoding="utf-8"), found).encode())
    return 0


def conclusions() -> Conclusions:
    """What the kept rows say."""
    return read_conclusions(read_table(KEPT / TABLE), SPEC, KEPT)


def digest_of_table() -> str:
    """Of the kept rows."""
    return sha256((KEPT / TABLE).read_bytes()).hexdigest()


def stamped(figure: bytes) -> bytes:
    """A PNG with few colours that names the rows it was drawn from."""
    info, stream = PngInfo(), BytesIO()
    info.add_text(STAMP, digest_of_table())
    Image.open(BytesIO(figure)).convert("RGB").quantize(COLOURS).save(stream, "PNG", optimize=True, pnginfo=info)
    return stream.getvalue()


def made(page: str, found: Conclusions) -> str:
    """The page with all of its marked parts made anew. Raises KeyError for a mark that stands for nothing."""
    parts = all_parts(found)
    return MARK.sub(lambda match: f"{match[1]}{parts[match[2]]}\n{match[3]}", page)


def all_parts(found: Conclusions) -> dict[str, str]:
    """Text by mark."""
    said, (head, laws) = found.advice.sentences, law_table(found)
    return {
        "about": _about(found),
        "answer": _parts(asked_sentence(found), _table(answer_table(found)), gpu_sentence(found),
                         " ".join(trust_sentences(found))),
        "spread": _parts(_table(spread_table(found)), _figure("spread")),
        "laws": _parts(_figure("laws"), _table((head, [row for row in laws if row[0] in (UNIFORM, DENOISED)]))),
        "sampling": _parts(said[ADAPTIVE], _figure("adaptive"), said[DENOISED], _figure("uniform-denoised")),
        "bounds": _parts(said[DEPTH], _figure("depth"), said.get(EDGES, ""), said[TEXTURES], _figure("texture-size")),
        "precision": _parts(said[CODECS], _figure("codecs"), said[ACCUMULATION]),
        "settings": f"```text\n{found.advice.lines()}```",
    }


def _about(found: Conclusions) -> str:
    setup, image = found.setup, found.spec.image
    examples = {row.example for row in found.rows if row.question == UNIFORM}
    return _wrapped(
        f"Measured on {setup.day}, {setup.machine}, {setup.workers} cores, {image.width}x{image.height} pixels: "
        f"{len(examples)} examples with references of {setup.reference_spp} spp and depth 64, and others once. All "
        f"rows are in [{TABLE}](images/accuracy/{TABLE}).")


def _parts(*parts: str) -> str:
    """Paragraphs, figures and tables."""
    return "\n\n".join(part if part.startswith(("|", "!")) else _wrapped(part) for part in parts if part)


def _wrapped(text: str) -> str:
    return fill(text, WIDTH, break_long_words=False, break_on_hyphens=False)


def _table(table: Table) -> str:
    return markdown_table(*table)


def _figure(name: str) -> str:
    return f"![{SHOWN[name]}](images/accuracy/{name}.png)"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
