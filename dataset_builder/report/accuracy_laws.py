"""Figures of the accuracy study's laws: measurements and the lines through them, and how examples differ."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dataset_builder.report.accuracy_figures import ERROR, dressed
from dataset_builder.report.page_parts import COLOURS, panels
from dataset_builder.studies.accuracy.conclusions import Conclusions
from dataset_builder.studies.accuracy.laws import Law, of_layer
from dataset_builder.studies.accuracy.rows import UNIFORM, AccuracyRow, of


def law_figure(found: Conclusions) -> Figure:
    """Error over spp of every layer: runs, the law of every example, and what was asked."""
    figure, axes = panels(len(found.answers.layers), "error² = a / n + b: runs, and the law of every example")
    for layer, one in zip(found.answers.layers, axes, strict=True):
        for number, law in enumerate(of_layer(found.answers.laws, UNIFORM, layer)):
            _law(one, law, [row for row in of(found.rows, UNIFORM, layer) if row.example == law.example],
                 COLOURS[number % len(COLOURS)])
        bought = found.answer.errors[layer][1] if found.answer and found.asked.hours else None
        error = bought or found.errors[layer]
        one.axhline(error, color="black", linestyle="--", linewidth=1,
                    label=f"{'bought' if bought else 'asked'}: {error:.2g}")
        dressed(one, layer, "samples per pixel, n", ERROR)
    return figure


def _law(axes: Axes, law: Law, rows: Sequence[AccuracyRow], colour: str) -> None:
    plain, bounds = ([row for row in rows if row.at_floor == hidden] for hidden in (False, True))
    axes.plot([row.spp for row in plain], [row.error for row in plain], marker="o", markersize=4, linestyle="none",
              color=colour, alpha=0.7)
    axes.plot([row.spp for row in bounds], [(row.relmse + row.floor) ** 0.5 for row in bounds], marker="v",
              markersize=5, linestyle="none", color=colour, markerfacecolor="white",
              label="upper bound" if bounds else None)
    across = np.geomspace(law.least / 4, 4 * law.most, 40)
    axes.plot(across, [law.error.at(1 / spp) ** 0.5 for spp in across], color=colour, linewidth=1.4, label=law.example)


def spread_figure(found: Conclusions) -> Figure:
    """Share of the examples below an error: at the spec's own samples, and at one number for all as asked."""
    figure, (axes,) = panels(1, "Errors over the dataset")
    for number, (layer, spread) in enumerate(found.answers.spread.items()):
        noise, floor, colour = np.array(spread.values), found.answers.floor(layer), COLOURS[number % len(COLOURS)]
        shares = (np.arange(len(noise)) + 0.5) / len(noise)
        axes.step((noise + floor) ** 0.5, shares, where="mid", color=colour, label=layer)
        axes.plot([(spread.limit + floor) ** 0.5], [0.95], marker="|", markersize=12, color=colour,
                  label=f"{layer}: 95% are below")
    dressed(axes, "at one sample per pixel; at n samples by sqrt(n) less", ERROR, "share of examples")
    axes.set(yscale="linear", ylim=(0, 1))
    return figure
