"""The study of a budget as one page: what was best, what it is told apart from, and what examples cost."""

from collections.abc import Sequence
from math import isfinite

from dataset_builder.errors import count_of
from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.lightnet.results.clustered_means import ONE_OBJECT, ClusteredMean
from dataset_builder.report.budget_figures import budget_figure
from dataset_builder.report.page_parts import Section, heading, png, rounded, write_study
from dataset_builder.studies.budget.arms import LOSSES, PASSES, PLAIN
from dataset_builder.studies.budget.budget_results import PSNR, ArmResult, BudgetResults
from dataset_builder.studies.budget.budget_study import BudgetStudy
from dataset_builder.studies.budget.render_costs import CostRow, cores_had, costs_of


def write_page(study: BudgetStudy, found: BudgetResults, costs: Sequence[CostRow], backend: str) -> None:
    """Write `report.html` and its figure. Raises OutputError."""
    figure = png(budget_figure(found, study.sentence))
    sections = [_best(found, figure), _denoised(found), _passes(found), _losses(found), _costs(study, list(costs))]
    write_study(study.out, f"What to spend render time on: {study.dataset.name}", _lead(study, found, backend),
                [section for section in sections if section.rows], figures={"budget": figure})


def sentences(found: BudgetResults) -> list[str]:
    """What the study says in words, a sentence for each budget."""
    return [_sentence(found, budget) for budget in found.budgets]


def _sentence(found: BudgetResults, budget: float) -> str:
    best, near = found.best(budget), found.as_good(budget)
    others = [one for one in found.at(budget) if one not in near]
    text = (f"Budget x{budget:g} ({best.arm.seconds:.0f} s): best is {best.arm.title}, {best.mean(PSNR):.2f} dB; "
            f"not told apart from it: {', '.join(one.arm.way for one in near[1:]) or 'none'}")
    return text + (f"; worse: {', '.join(one.arm.way for one in others)}." if others else "; worse: none.")


def _lead(study: BudgetStudy, found: BudgetResults, backend: str) -> list[str]:
    objects, examples = len(set(found.objects)), len(found.objects)
    seeds = "one seed, whose part is not in the intervals" if found.seeds == 1 else (
        f"{found.seeds} seeds, which move an arm's mean by {found.seed_deviation:.2f} dB (standard deviation over "
        "all arms)")
    return [
        f"LighTNet: {study.sentence}. Rendered by {backend}.",
        f"Every arm of a budget costs the same render seconds, and is trained for the same number of steps. It has the "
        f"first examples of its mix: one view of each pair of object and scene before a second one. Measured on "
        f"{examples} held-out examples of {count_of(objects, 'object')}, none of them in training, rendered once with "
        f"{study.size.clean} spp, I_s and S' as well as I_t.",
        f"Intervals have 95% confidence, over held-out objects and {seeds}. Each holds for one difference: of many, "
        "one in twenty is told apart by chance, and the best of a budget was chosen by what it is judged by.",
        *[f"{ONE_OBJECT}."] * (objects == 1),
        "Small networks and few steps show which way large effects go, not what a full training would reach.",
    ]


def _best(found: BudgetResults, figure: bytes) -> Section:
    rows = [[f"x{budget:g}", one.arm.way, f"{one.learnt} of {one.arm.examples}",
             *(rounded(one.mean(metric.name), metric.name) for metric in METRICS),
             "best" if one is found.best(budget) else _difference(found.less(one, found.best(budget)))]
            for budget in found.budgets for one in sorted(found.at(budget), key=lambda one: -one.mean(PSNR))]
    return Section(question="Many examples with noise, or few without?", answer=" ".join(sentences(found)),
                   figure=figure, rows=rows, head=("budget", "examples are rendered with", "examples that passed gates",
                                                   *map(heading, METRICS), "PSNR less the best"))


def _denoised(found: BudgetResults) -> Section:
    raw = {(one.arm.budget, one.arm.mix.spp): one for one in found.arms
           if one.arm.even and not one.arm.mix.denoised}
    pairs = [(one, raw[one.arm.budget, one.arm.mix.spp]) for one in found.arms if one.arm.mix.denoised]
    rows = [[f"x{one.arm.budget:g}", f"{one.arm.mix.spp} spp", f"{one.learnt}", f"{other.learnt}",
             _difference(found.less(one, other))] for one, other in pairs]
    return Section(question="Denoised or raw?", rows=rows, answer="PSNR of the denoised arm less that of the raw one, "
                   "which has more examples for the same seconds.",
                   head=("budget", "samples", "examples, denoised", "examples, raw", "PSNR, denoised less raw"))


def _passes(found: BudgetResults) -> Section:
    raised = [one for one in found.arms if one.arm.mix.raised]
    rows = [[PASSES[one.arm.mix.raised], one.arm.mix.title, f"{one.learnt}", f"{other.learnt}",
             _difference(found.less(one, other))] for one in raised if (other := _beside(found, one))]
    return Section(question="Which layers deserve samples?", rows=rows, answer="One pass has more samples than the "
                   "others, for fewer examples; against the same samples in all passes.",
                   head=("layer", "rendered with", "examples", "examples, all alike", "PSNR, raised less all alike"))


def _beside(found: BudgetResults, one: ArmResult) -> ArmResult | None:
    """The arm of the same budget whose passes all have what those have that were not raised."""
    return next((other for other in found.at(one.arm.budget) if other.arm.mix.spp == one.arm.mix.spp
                 and other.arm.even and not other.arm.mix.denoised), None)


def _losses(found: BudgetResults) -> Section:
    rows = [[one.arm.mix.title, LOSSES[one.arm.noise], f"{one.learnt}", _difference(found.less(one, found.plain(one)))]
            for one in found.arms if one.arm.noise != PLAIN]
    return Section(question="Do losses that expect noise pay?", rows=rows, answer="The same examples as with a plain "
                   "loss: what these losses need beyond them, standard errors and I_t of half of the samples, costs no "
                   "rendering.", head=("rendered with", "loss", "examples", "PSNR, less that of a plain loss"))


def _costs(study: BudgetStudy, rows: list[CostRow]) -> Section:
    costs = costs_of(study, rows)
    shown = [[mix.title, f"{cost.seconds:.2f} ± {cost.error:.2f}", f"{cost.examples}"] for mix, cost in costs.items()]
    return Section(question="What does an example cost?", rows=shown, answer="Seconds of the processor, all threads "
                   "together (on a GPU of the clock), mean and standard error over the examples that were timed; the "
                   "same ones for every mix. The machine gave this study "
                   f"{cores_had(rows):.2f} seconds of the processor in a second while they were taken.",
                   head=("mix", "seconds", "examples timed"))


def _difference(found: ClusteredMean) -> str:
    width = f" ± {rounded(found.half_width, PSNR)}" if isfinite(found.half_width) else ""
    return f"{rounded(found.mean, PSNR, '+')}{width} dB, {'told apart' if found.told_apart else 'not told apart'}"
