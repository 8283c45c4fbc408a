"""Figures of the study of a budget: quality against render hours and against spp, what raising one pass brings, and
what losses that expect noise bring."""

from collections.abc import Sequence
from math import isfinite

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dataset_builder.report.page_parts import COLOURS, panels
from dataset_builder.studies.budget.arms import LOSSES, PASSES, PLAIN
from dataset_builder.studies.budget.budget_results import PSNR, ArmResult, BudgetResults

HOUR = 3600
SPREAD = 0.04
"""Share of a budget that arms stand apart along it, so that their bars do not hide each other."""


def budget_figure(found: BudgetResults, settings: str) -> Figure:
    """Four panels; a star is the best arm of a budget, bars are 95% intervals of the difference from it, and in the
    last of that from the plain loss."""
    figure, (hours, spp, passes, losses) = panels(4, "One render budget, spent in several ways\n" + settings)
    _over_hours(hours, found)
    _over_spp(spp, found)
    _by_pass(passes, found)
    _by_loss(losses, found)
    figure.supxlabel("Star: best of its budget. Bars: 95% intervals of the difference from it, over held-out objects "
                     "and seeds; by loss, from the plain one on the same examples.", fontsize=8)
    return figure


def _even(found: BudgetResults) -> list[ArmResult]:
    return [one for one in found.arms if one.arm.even]


def _over_hours(axes: Axes, found: BudgetResults) -> None:
    kinds = sorted({(one.arm.mix.spp, one.arm.mix.denoised) for one in _even(found)})
    grid = sorted({spp for spp, _ in kinds})
    for number, (spp, denoised) in enumerate(kinds):
        own = [one for one in _even(found) if (one.arm.mix.spp, one.arm.mix.denoised) == (spp, denoised)]
        apart = 1 + SPREAD * (number - (len(kinds) - 1) / 2)
        _points(axes, found, own, [apart * one.arm.seconds / HOUR for one in own],
                color=COLOURS[grid.index(spp) % len(COLOURS)], denoised=denoised,
                label=f"{spp} spp{', denoised' if denoised else ''}")
    seconds = {one.arm.budget: one.arm.seconds for one in found.arms}
    axes.set(title="against hours of rendering", xlabel="budget, in hours of one core or of a GPU", xscale="log",
             ylabel="PSNR of I_t, dB", xticks=[seconds[budget] / HOUR for budget in found.budgets])
    axes.set_xticklabels([f"x{budget:g}: {seconds[budget] / HOUR:.3g} h" for budget in found.budgets])
    axes.minorticks_off()
    axes.legend(fontsize=7, ncols=2)


def _over_spp(axes: Axes, found: BudgetResults) -> None:
    grid = sorted({one.arm.mix.spp for one in _even(found)})
    for number, budget in enumerate(found.budgets):
        for denoised in sorted({one.arm.mix.denoised for one in found.arms}):
            own = [one for one in _even(found) if one.arm.budget == budget and one.arm.mix.denoised == denoised]
            _points(axes, found, own, [one.arm.mix.spp * (1.06 if denoised else 1) for one in own],
                    color=COLOURS[number % len(COLOURS)], denoised=denoised,
                    label=f"budget x{budget:g}{', denoised' if denoised else ''}")
            for one in own if not denoised else ():
                axes.annotate(f"{one.learnt}", (one.arm.mix.spp, one.mean(PSNR)), xytext=(-4, 5), fontsize=7,
                              textcoords="offset points", ha="right", color="#606060")
    axes.set(title="against samples; numbers: examples, raw", xlabel="samples per pixel", xscale="log", xticks=grid,
             xticklabels=[f"{spp}" for spp in grid])
    axes.minorticks_off()
    axes.legend(fontsize=7)


def _by_pass(axes: Axes, found: BudgetResults) -> None:
    """Arms with a raised pass beside those with even samples, at the largest budget."""
    raised = [one for one in found.arms if one.arm.mix.raised]
    base, more = raised[0].arm.mix.spp, max(getattr(raised[0].arm.mix, name) for name in PASSES)
    beside = {f"all {spp}": one for one in found.at(found.budgets[-1]) if one.arm.even and not one.arm.mix.denoised
              and (spp := one.arm.mix.spp) in (base, more)}
    shown = beside | {f"{PASSES[one.arm.mix.raised]} {more}": one for one in raised}
    own = list(shown.values())
    _points(axes, found, own, list(range(len(own))), color=COLOURS[2], denoised=False, label="", line="none")
    names = [f"{name}\n{one.learnt} examples" for name, one in shown.items()]
    axes.set(title=f"{base} spp, one pass at {more}; budget x{found.budgets[-1]:g}", xticks=range(len(own)))
    axes.set_xticklabels(names, fontsize=7)
    axes.set_xlim(-0.5, len(own) - 0.5)


def _by_loss(axes: Axes, found: BudgetResults) -> None:
    """Losses that expect noise beside the plain one, on the same examples, at the largest budget."""
    noisy = [one for one in found.arms if one.arm.noise != PLAIN]
    for number, spp in enumerate(dict.fromkeys(one.arm.mix.spp for one in noisy)):
        others = [one for one in noisy if one.arm.mix.spp == spp]
        plain = found.plain(others[0])
        places = [list(LOSSES).index(one.arm.noise) + 0.12 * number for one in (plain, *others)]
        _points(axes, found, [plain, *others], places, color=COLOURS[number % len(COLOURS)], denoised=False,
                label=f"{spp} spp, {plain.learnt} examples", line="none", against=plain)
    axes.set(title=f"by loss, the same examples; budget x{found.budgets[-1]:g}", xticks=range(len(LOSSES)))
    axes.set_xticklabels([name.replace(" of ", " of\n") for name in LOSSES.values()], fontsize=7)
    axes.set_xlim(-0.5, len(LOSSES) - 0.5)
    axes.legend(fontsize=7)


def _points(axes: Axes, found: BudgetResults, own: Sequence[ArmResult], places: Sequence[float], *, color: str,
            denoised: bool, label: str, line: str = "", against: ArmResult | None = None) -> None:
    """Arms with the intervals of their differences, from the best of their budget unless `against` says otherwise."""
    best = [found.best(one.arm.budget) for one in own]
    others = [against or top for top in best]
    widths = [0.0 if one is other else found.less(one, other).half_width
              for one, other in zip(own, others, strict=True)]
    axes.errorbar(places, [one.mean(PSNR) for one in own], yerr=[one if isfinite(one) else 0.0 for one in widths],
                  color=color, marker="s" if denoised else "o", markerfacecolor="white" if denoised else color,
                  linestyle=line or ("--" if denoised else "-"), linewidth=1.4, markersize=5, capsize=3,
                  elinewidth=0.8, label=label or None)
    for one, place, top in zip(own, places, best, strict=True):
        if one is top:
            axes.plot([place], [one.mean(PSNR)], marker="*", markersize=16, color="#E69F00", markeredgecolor="black",
                      markeredgewidth=0.7, zorder=5, linestyle="none")
