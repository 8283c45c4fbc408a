"""The answers of the accuracy study in words and tables, the same for the terminal, the page and the documentation."""

import math
from collections.abc import Sequence

from dataset_builder.layers import LAYERS, sampled_as
from dataset_builder.report.console import duration
from dataset_builder.report.page_parts import markdown_table
from dataset_builder.studies.accuracy.answers import CLEAR, HOUR, Answer
from dataset_builder.studies.accuracy.conclusions import Conclusions
from dataset_builder.studies.accuracy.laws import GOALS
from dataset_builder.studies.accuracy.other_examples import SURE, NoiseSpread, sure_share
from dataset_builder.studies.accuracy.rows import ADAPTIVE, DENOISED, UNIFORM
from dataset_builder.studies.accuracy.sampling_advice import JITTER, RESAMPLED
from dataset_builder.studies.accuracy.straight_line import Line

Table = tuple[Sequence[str], list[list[str]]]
LAW_HEAD = ("sampling", "layer", "example", "a: error² at n = 1", "b: error² that stays", "c: seconds, fixed",
            "d: ms per n", "scatter of error², seconds")
WAYS = {UNIFORM: "uniform spp", ADAPTIVE: "goals", DENOISED: "denoised"}
FEW = 8
"""Examples below which a warning says that the limit of 95% rests on few."""


def law_table(found: Conclusions) -> Table:
    """The law of every layer and example, with 95% intervals. Goals have no time of their own: one layer's rounds are
    too few."""
    return LAW_HEAD, [
        [law.question, law.layer, law.example, _with(law.error.slope, law.error.slope_within),
         "" if law.question in GOALS else _bound(law.error),
         *(("", "") if law.question in GOALS else (_bound(law.time), _with(1e3 * law.time.slope,
                                                                           1e3 * law.time.slope_within))),
         f"{law.error.spread:.0%}, {law.time.spread:.0%}"] for law in found.answers.laws]


def _with(value: float, within: float) -> str:
    return f"{value:.3g} ± {within:.2g}"


def _bound(line: Line) -> str:
    """The rest, or what it is below at most where its interval holds 0."""
    most = line.rest + line.rest_within
    return f"< {most:.2g}" if line.rest <= line.rest_within else _with(line.rest, line.rest_within)


def spread_table(found: Conclusions) -> Table:
    """How noise is spread over the examples, and what the spec as it stands gives."""
    spp = found.work.spp
    return ("layer", "examples", "a of the median example", "95% are below", "spp of the spec", "error there, median",
            "95% are below"), [
        [layer, str(len(spread.values)), _median(spread), f"{spread.limit:.3g}",
         str(spp[LAYERS[layer].render_pass]), *_shown_errors(found.answers.fixed(dict(spp)), layer)]
        for layer, spread in found.answers.spread.items()]


def _median(spread: NoiseSpread) -> str:
    low, high = spread.within
    return f"{spread.median:.3g}" + (f" ({low:.2g} to {high:.2g})" if math.isfinite(high) else "")


def _shown_errors(answer: Answer, layer: str) -> list[str]:
    return [f"{value:.1%}" for value in answer.errors[layer]]


def answer_table(found: Conclusions) -> Table:
    """Every way to what was asked, with its price; the one that is recommended says so."""
    answers, errors = found.answers, found.errors
    if found.answer and found.asked.hours:
        errors = {layer: limit for layer, (_, limit) in found.answer.errors.items()}
    ways = {UNIFORM: answers.uniform(errors), ADAPTIVE: answers.goals(errors), DENOISED: answers.denoised(errors)}
    head = ("way", *answers.layers, "hours here", "core-hours" if not found.setup.gpu else "GPU-hours", "GB")
    rows = [_row("as the spec stands", answers.fixed(dict(found.work.spp)), found)]
    for way, answer in ways.items():
        chosen = found.answer is not None and way == found.answer.way
        name = WAYS[way] + (" (recommended)" if chosen else ": biased, never recommended" if way == DENOISED else "")
        rows.append(_row(name, answer, found) if answer else [name, *("does not get there" for _ in answers.layers),
                                                               "", "", ""])
    return head, rows


def _row(name: str, answer: Answer, found: Conclusions) -> list[str]:
    cells = []
    for layer in found.answers.layers:
        spp = answer.spp[sampled_as(LAYERS[layer].render_pass)]
        cells.append(f"goal {answer.goals[layer]:g}, {spp:.0f} spp on average" if answer.goals else f"{spp:.0f} spp")
    return [name, *cells, _with_share(answer.core_hours / found.setup.workers, answer.within),
            _with_share(answer.core_hours, answer.within), f"{answer.gigabytes:.3g}"]


def _with_share(value: float, share: float) -> str:
    return f"{value:.3g} ± {share:.0%}"


def asked_sentence(found: Conclusions) -> str:
    """What was asked, and the answer."""
    examples = found.asked.examples or found.work.examples
    if found.asked.hours:
        asked = f"{found.asked.hours:g} hours for {examples:,} examples"
    else:
        asked = ", ".join(f"{error:.2g} in {layer}" for layer, error in found.errors.items()) + \
                f" for 95% of {examples:,} examples"
    if (answer := found.answer) is None:
        if found.asked.hours:
            return f"Asked: {asked}. No error below 100% surely fits into that: what is fixed takes longer."
        floors = {layer: math.sqrt(found.answers.floor(layer)) for layer in found.answers.layers}
        most = ", ".join(f"{layer} {floor:.1%}" for layer, floor in floors.items() if floor >= found.errors[layer])
        return f"Asked: {asked}. No number of samples gets there; the error that stays is {most}."
    next_down = ""
    if finer := found.asked.hours and found.answers.of_hours(found.asked, found.setup.workers)[1]:
        next_down = (f" The next errors down, {_limits(finer)}, take {_took(finer, found)}: not surely within what was "
                     "asked.")
    return (f"Asked: {asked}. Recommended: {WAYS[answer.way]}, 95% of the examples below {_limits(answer)}, in "
            f"{_took(answer, found)} on this machine ({found.setup.workers} "
            f"{'GPU' if found.setup.gpu else 'cores'}), {answer.gigabytes:.3g} GB.{next_down}")


def _limits(answer: Answer) -> str:
    return ", ".join(f"{layer} {limit:.2g}" for layer, (_, limit) in answer.errors.items())


def _took(answer: Answer, found: Conclusions) -> str:
    return f"{duration(answer.core_hours * HOUR / found.setup.workers)} ± {answer.within:.0%}"


def gpu_sentence(found: Conclusions) -> str:
    """What a GPU would take: measured on one, or said to be a model."""
    if found.setup.gpu:
        return "These hours were measured on a GPU."
    if found.answer is None:
        return ""
    if speed := found.asked.gpu_speed:
        return (f"On a GPU {speed:g} times as fast as a core: {duration(found.answer.core_hours * HOUR / speed)}. That "
                "speed is what you gave, and the time a model: nothing was measured on a GPU.")
    return ("On a GPU: not measured. One that is X times as fast as a core here takes "
            f"{found.answer.core_hours:.3g} / X hours: run the study there with `--backend cuda`, or say "
            "`--gpu-speed X`.")


def _step(found: Conclusions) -> str:
    """Where settings follow timings."""
    return (" These hours lie near a step between two answers, and either is as good." if found.asked.hours else
            f" Goals save close to {1 - CLEAR:.0%} of the hours, from which on they are recommended: with and without "
            "goals is as good.")


def _sure(measured: int) -> str:
    """How far 95% can be trusted that follow from so many examples."""
    share = sure_share(measured)
    said = (f"examples differ is known from {measured} of them: 95% are expected below these errors, and "
            + (f"{math.floor(100 * share)}% surely (with a confidence of {SURE:.0%}, where noise is log-normal)"
               if share else "no share of them surely"))
    return f"WARNING: how {said}; measure more (--budget medium or full)." if measured < FEW else f"How {said}."


def trust_sentences(found: Conclusions) -> list[str]:
    """How far timings can be trusted, with a warning where they cannot."""
    wall, worked = found.scatters
    measured = min(len(spread.values) for spread in found.answers.spread.values())
    said = [f"Runs of one setting scatter by {wall:.0%} in wall time and {worked:.0%} in CPU time (standard "
            f"deviation); hours are from {'wall' if found.setup.gpu else 'CPU'} time.",
            f"With timings off by {JITTER:.0%} the settings change in {found.changed:.0%} of {RESAMPLED} resamplings."
            + (_step(found) if found.changed else ""), _sure(measured)]
    if not found.answers.goals_known:
        said.append("Goals are not recommended: how errors follow them is not known, since some interval of a holds 0; "
                    "measure more (--budget medium or full, more --examples).")
    said += [f"The mean of {layer} is not known in {spread.unknown} of {spread.measured} examples: rare bright paths "
             "follow no such law" + (", and what is said of 95% is said of the others."
                                     if spread.unknown < spread.measured else ", and these answers are guesses.")
             for layer, spread in found.answers.spread.items() if spread.unknown]
    if found.answer and found.answer.within > found.asked.within:
        said.append(f"WARNING: the hours are known to ± {found.answer.within:.0%}, asked was "
                    f"± {found.asked.within:.0%}: "
                    + ("the machine is too restless; run the study when it is idle."
                       if (wall if found.setup.gpu else worked) / math.sqrt(measured) > found.asked.within / 4
                       else "examples differ too much; measure more (--budget full)."))
    return said


def summary_lines(found: Conclusions) -> list[str]:
    """What the terminal shows."""
    return [markdown_table(*law_table(found)), "", markdown_table(*spread_table(found)), "",
            markdown_table(*answer_table(found)), "", asked_sentence(found), gpu_sentence(found),
            *trust_sentences(found)]
