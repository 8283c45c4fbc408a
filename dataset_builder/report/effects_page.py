"""The effects study as files: a figure, and the page with seconds, differences and decisions."""

from collections.abc import Sequence
from math import ceil

import numpy as np
from matplotlib.figure import Figure

from dataset_builder.errors import count_of
from dataset_builder.report.page_parts import COLOURS, PALE, Section, panels, png, write_study
from dataset_builder.studies.effects.effects_study import (
    DEEP,
    DEEPER,
    REPEATS,
    Compared,
    EffectsStudy,
    decisions,
    saving,
    seconds_by_pass,
)
from dataset_builder.studies.effects.picture_differences import FACTOR, SEEN, SIGMAS, Difference


def effects_figure(found: Sequence[Compared]) -> Figure:
    """Seconds of every example both ways, and the bias of every layer with what is allowed."""
    figure, (left, right) = panels(2, "Only what the scene needs, compared with simulating everything")
    places = np.arange(len(found))
    for offset, (name, colour) in enumerate((("planned", COLOURS[0]), ("everything", PALE))):
        left.bar(places + 0.4 * (offset - 0.5), [sum(getattr(one, name).values()) for one in found], 0.38,
                 color=colour, label={"planned": "as planned", "everything": "everything simulated"}[name])
    left.set(title=f"seconds per example: everything takes {saving(found):.2f} times as long", ylabel="seconds",
             xticks=places)
    left.set_xticklabels([one.example for one in found], rotation=30, ha="right", fontsize=8)
    left.legend(fontsize=8)
    layers = list(dict.fromkeys(one.layer for compared in found for one in compared.differences))
    for number, compared in enumerate(found):
        own = compared.differences
        rows = [layers.index(one.layer) + 0.6 * (number - (len(found) - 1) / 2) / max(len(found) - 1, 1) for one in own]
        right.errorbar([100 * one.bias for one in own], rows, xerr=[100 * one.sigmas * one.bias_se for one in own],
                       linestyle="none", marker="o", markersize=3.5, color=COLOURS[number % len(COLOURS)],
                       label=compared.example, linewidth=1)
    if allowed := [one.allowed for compared in found for one in compared.differences]:
        right.axvspan(-100 * allowed[0], 100 * allowed[0], color="#e8f3ec", zorder=0)
        right.set_xlim(*(sign * 100 * max(3 * allowed[0], _widest(found)) for sign in (-1, 1)))
    right.set(title="bias, bars: what noise may add; shaded: allowed", xlabel="mean of the difference, %",
              yticks=range(len(layers)), yticklabels=layers)
    right.invert_yaxis()
    right.legend(fontsize=7)
    return figure


def _widest(found: Sequence[Compared]) -> float:
    widths = [abs(one.bias) for compared in found for one in compared.differences if np.isfinite(one.bias)]
    return 1.2 * max(widths, default=0.0)


def write_page(study: EffectsStudy, found: Sequence[Compared], backend: str) -> None:
    """Write `figures/effects.png` and `report.html` in the study's folder. Raises OutputError."""
    figure = png(effects_figure(found))
    allowed = study.spec.dataset.render.bias
    lead = [
        f"{count_of(len(found), 'example')}, {backend}, {REPEATS} times each. Both sides have the same spp and "
        f"independent samples; everything is simulated with paths of {DEEPER} times the planned edges, at least "
        f"{DEEP}.",
        f"A layer differs where its mean does by more than {allowed:g} of it and noise, or where too many pixels do: "
        f"the share of those off by more than {allowed:g} of the layer's mean plus {SIGMAS:g} of their own standard "
        f"errors is more than {FACTOR:g} times what noise gives (Student's t). It is the same where a difference of "
        f"{SEEN:g} times what is allowed would have been seen with a probability of 95%, and not resolved otherwise. "
        "Layers without light are judged by their mean alone.",
    ]
    write_study(study.out, f"Only what the scene needs: {study.spec.dataset.name}", lead,
                [_differences(found, figure), _seconds(found), _decisions(found)], figures={"effects": figure})


def verdict(found: Sequence[Compared]) -> str:
    """In sentences: how much time is saved, which layers differ by more than they may, and what was not resolved."""
    every = [one for compared in found for one in compared.differences]
    worst = max(every, key=lambda one: abs(one.bias))
    text = (f"Simulating everything takes {saving(found):.2f} times as long as what is planned; the worst mean "
            f"differs by {worst.bias:+.2%} +- {worst.bias_se:.2%} ({worst.layer} of {worst.example}, where "
            f"{worst.smallest:.2%} would have been seen).")
    wrong, unclear = ([one for one in every if one.verdict == name] for name in ("differs", "not resolved"))
    if wrong:
        text += f" Beyond the stated error: {_named(wrong)}."
    if unclear:
        most = max(unclear, key=lambda one: one.smallest)
        text += (f" Not resolved: {_named(unclear)}; in {most.layer} of {most.example} only a difference of "
                 f"{most.smallest:.2%} would have been seen. Take about {ceil(most.samples)} times the samples "
                 f"(`render.spp`), or allow a larger `render.bias`.")
    return text if wrong or unclear else f"{text} No layer of any example differs by more than its stated error."


def _named(differences: Sequence[Difference]) -> str:
    return ", ".join(f"{one.layer} of {one.example}" for one in differences)


def _differences(found: Sequence[Compared], figure: bytes) -> Section:
    return Section(question="Does leaving effects out change the picture, and what does it save?",
                   answer=verdict(found), figure=figure,
                   head=("example", "layer", "bias", "standard error", "smallest seen", "worst z", "pixels beyond",
                         "noise gives", "verdict"),
                   rows=[_row(one) for compared in found for one in compared.differences])


def _row(one: Difference) -> list[str]:
    return [one.example, one.layer, f"{one.bias:+.3%}", f"{one.bias_se:.3%}", f"{one.smallest:.2%}",
            f"{one.worst_z:.1f}", f"{one.share:.2%}", f"{one.expected:.2%}", one.verdict]


def _seconds(found: Sequence[Compared]) -> Section:
    rows = [[name, f"{planned:.3f}", f"{everything:.3f}", f"{everything / planned:.2f}" if planned else ""]
            for name, (planned, everything) in seconds_by_pass(found).items()]
    return Section(question="Where is time saved?", answer="Seconds per example and pass, means over examples.",
                   head=("pass", "as planned", "everything simulated", "ratio"), rows=rows)


def _decisions(found: Sequence[Compared]) -> Section:
    rows = [[effect, choice, f"{count} of {len(found)}", reason]
            for (effect, choice), (count, reason) in decisions(found).items()]
    return Section(question="What was decided?", answer="Decisions of planning, with the reason in one example.",
                   head=("effect", "choice", "examples", "reason"), rows=rows)
