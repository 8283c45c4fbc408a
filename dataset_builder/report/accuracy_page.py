"""The accuracy study as files: figures, and the page with questions, answers, figures and tables."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from dataset_builder.errors import count_of
from dataset_builder.report.accuracy_answers import (
    Table,
    answer_table,
    asked_sentence,
    gpu_sentence,
    law_table,
    spread_table,
    trust_sentences,
)
from dataset_builder.report.accuracy_figures import accuracy_figures
from dataset_builder.report.accuracy_laws import law_figure, spread_figure
from dataset_builder.report.page_parts import Section, png, write_study
from dataset_builder.studies.accuracy.accuracy_study import AccuracyStudy
from dataset_builder.studies.accuracy.bounds import DEPTH, EDGES, TEXTURES
from dataset_builder.studies.accuracy.conclusions import Conclusions
from dataset_builder.studies.accuracy.curves import Advice, curve
from dataset_builder.studies.accuracy.precision import ACCUMULATION, CODECS, codec_means
from dataset_builder.studies.accuracy.rows import ADAPTIVE, ADAPTIVE_DENOISED, DENOISED, UNIFORM, AccuracyRow, layers_in
from dataset_builder.studies.accuracy.workbench import REFERENCE_DEPTH

QUESTIONS = {
    ADAPTIVE: "What does adaptive sampling save?",
    DENOISED: "What does denoising gain, and what error does it leave?",
    DEPTH: "How long must light paths be?",
    EDGES: "How fine must the rough mesh be?",
    TEXTURES: "How many texels do D and I_t need?",
    CODECS: "Half or float, and which codec?",
    ACCUMULATION: "Do float32 sums drift?",
}
SHOWN = ("setting", "layer", "seconds", "spp", "error", "PSNR, dB", "FLIP")


def write_page(study: AccuracyStudy, found: Conclusions) -> None:
    """Write `figures/*.png` and `report.html` in the study's folder. Raises OutputError."""
    rows, advice = counted(found), found.advice
    figures = all_figures(found)
    sections = [*_answers(found, figures), *(_section(question, text, rows, advice, figures[question])
                                             for question, text in QUESTIONS.items() if question in figures)]
    write_study(study.out, f"What accuracy costs: {found.spec.name}", _lead(found), sections, figures=figures,
                settings=advice.lines())


def all_figures(found: Conclusions) -> dict[str, bytes]:
    """PNG of every figure by name; seconds are those that count."""
    return {"laws": png(law_figure(found)), "spread": png(spread_figure(found)),
            **accuracy_figures(counted(found), found.advice, found.spec.render.bias)}


def counted(found: Conclusions) -> list[AccuracyRow]:
    """The rows with the seconds that count, CPU seconds but on a GPU, wherever they were measured."""
    return [replace(row, seconds=time) if math.isfinite(time := getattr(row, found.setup.clock)) else row
            for row in found.rows]


def _answers(found: Conclusions, figures: Mapping[str, bytes]) -> list[Section]:
    def section(question: str, answer: str, table: Table, figure: str = "") -> Section:
        return Section(question=question, answer=answer, figure=figures.get(figure, b""), head=table[0], rows=table[1])

    answer = " ".join(filter(None, (asked_sentence(found), gpu_sentence(found), *trust_sentences(found))))
    return [section("What do I get, and what does it cost?", answer, answer_table(found)),
            section("How do examples differ?", "Noise of one sample per pixel over the examples of the dataset, which "
                    "tells what error they have at any other number.", spread_table(found), "spread"),
            section("By which law?", "error² = a / n + b and seconds = c + d n, n samples per pixel (for goals error² "
                    "= a g² in the goal g), ± half a 95% interval; b and c whose interval holds 0 are bounds.",
                    law_table(found), "laws")]


def _lead(found: Conclusions) -> list[str]:
    examples = list(dict.fromkeys(row.example for row in found.rows if row.question == UNIFORM))
    image, setup = found.spec.image, found.setup
    return [
        f"{count_of(len(examples), 'example')} ({', '.join(examples)}), {image.width}x{image.height} pixels, "
        f"{setup.machine}, {setup.day}.",
        f"Errors are against references of {setup.reference_spp} spp and depth {REFERENCE_DEPTH} with "
        "independent samples, less the known noise of the references; where that noise hides the error, the point is "
        "hollow and an upper bound. Error is sqrt(relMSE), relMSE = mean((x - r)^2 / (r^2 + 0.01 m^2)), m the mean of "
        "the layer, over the object's pixels or the frame, as the dataset asks for the layer. PSNR is taken after the "
        "tone mapping of the previews, FLIP is HDR-FLIP. Means over examples are geometric. Seconds are those of the "
        "pass that makes the layer on all cores together, without compiling kernels.",
    ]


def _section(question: str, text: str, rows: Sequence[AccuracyRow], advice: Advice, figure: bytes) -> Section:
    answers = [advice.sentences.get(question, "Not enough was measured to answer this.")]
    if question == DENOISED:
        answers.append(advice.sentences.get(ADAPTIVE_DENOISED, ""))
    head, body = _table(question, rows)
    return Section(question=text, answer=" ".join(filter(None, answers)), figure=figure, head=head, rows=body)


def _table(question: str, rows: Sequence[AccuracyRow]) -> tuple[Sequence[str], list[list[str]]]:
    if question == CODECS:
        return ("type and codec", "kB per example", "ms to encode", "ms to decode"), [
            [name, f"{mean['bytes'] / 1e3:.1f}", f"{1e3 * mean['encode_seconds']:.1f}",
             f"{1e3 * mean['decode_seconds']:.1f}"] for name, mean in codec_means(rows).items()]
    names = [question, ADAPTIVE_DENOISED] if question == DENOISED else [question]
    points = [(layer, point) for name in names for layer in layers_in(rows, name) for point in curve(rows, name, layer)]
    return SHOWN, [[point.setting, layer, f"{point.seconds:.3g}", _text(point.spp, ".0f"), f"{point.error:.2%}",
                    _text(point.psnr, ".1f"), _text(point.flip, ".4f")] for layer, point in points]


def _text(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else ""
