"""How far denoised layers may be trusted: the bias on a few examples, rendered as the dataset asks and converged.

Measured once before a build, kept beside the staged examples, and written into the record of every example.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dataset_builder.engine.maker_file import MakerFile
from dataset_builder.engine.unit import BuildJob, planner_of
from dataset_builder.errors import OutputError, PlanError, Problem, UserError
from dataset_builder.label.example_label import Denoised
from dataset_builder.label.example_plan import ExamplePlan, GoalPlan
from dataset_builder.planning.catalogue import ExampleRef, units
from dataset_builder.planning.effects.decisions import FACTOR, REPEATS
from dataset_builder.planning.plan import Planner
from dataset_builder.rendering.backend import activate
from dataset_builder.seeding import derive_seed
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.spread import spread_indices

DARK = 0.01
"""Added to the squared reference in relMSE, so that black pixels do not rule it."""

BLOCK, LEAST_BLOCKS = 8, 6
"""Pixels of a block's side, about how far the filter looks, and how many blocks tell an error."""
SURE = 1.645
"""Standard errors that a figure is above with a probability of 5%."""
DIGITS = 6
Images = Mapping[str, np.ndarray]


@dataclass(frozen=True, kw_only=True)
class Figures:
    """One layer of one example, as `Denoised` has them of all; squared ones are relative."""

    bias: float
    bias_error: float
    """Still squared."""
    pixel_bias: float
    """Still squared, less what the reference's noise adds: it may come out below 0 where noise hides it."""
    pixel_bias_error: float
    """Standard error of that, squared; infinite where the object is too small to tell."""
    relmse_raw: float
    relmse_denoised: float
    relmse_reference: float

    @property
    def known(self) -> bool:
        """Whether they say anything: not of a layer that is black in the reference, or of an unknown error."""
        return all(map(math.isfinite, (self.bias, self.bias_error, self.pixel_bias, self.relmse_raw)))


def calibrate(loaded: LoadedSpec, job: BuildJob, made_by: Mapping[str, str], *, run: Callable[..., Iterator[Any]],
              workers: int) -> tuple[Denoised, ...]:
    """Figures of every layer that the dataset denoises, in the spec's order, the same on every repetition.

    Taken from the job's folder where they were measured before, by the same versions. Raises PlanError where no example
    can be rendered, OutputError as `run` and writing do.
    """
    spec = loaded.dataset.render.denoise
    file = MakerFile(job.folder, "denoised", Denoised, loaded.spec_digest, made_by)
    if known := file.read():
        return known
    refs = candidates(Planner(loaded), spec.examples)
    examples = _measured(refs, spec.examples, partial(run, partial(measure, job)), workers)
    found = tuple(_combined(name, [example[name] for example in examples]) for name in spec.layers)
    file.write(found)
    return found


def candidates(planner: Planner, count: int) -> list[ExampleRef]:
    """One example of every view: first `count` that are spread evenly over the dataset, then all others in order."""
    first = [unit.examples[0] for unit in units(planner.examples)]
    spread = spread_indices(len(first), count)
    return [*(first[i] for i in spread), *(ref for i, ref in enumerate(first) if i not in spread)]


def _measured(refs: Sequence[ExampleRef], count: int, run: Callable[..., Iterator[Any]],
              workers: int) -> list[dict[str, Figures]]:
    """Figures of the first `count` examples that can be planned and rendered; the first reason where none can."""
    found, failed = dict[int, dict[str, Figures]](), dict[int, tuple[Problem, ...]]()
    while refs and len(found) < count:
        now, refs = refs[:count - len(found)], refs[count - len(found):]
        for index, figures, problems in run(now, workers=min(workers, len(now))):
            if problems:
                failed[index] = problems
            else:
                found[index] = figures
    if not found:
        rule = "expected an example to measure the bias on, but none can be planned and rendered; the first reason:"
        raise PlanError([Problem(where="", path="render.denoise", rule=rule), *next(iter(failed.values()), ())])
    return [found[index] for index in sorted(found)]


def measure(job: BuildJob, ref: ExampleRef) -> tuple[int, dict[str, Figures], tuple[Problem, ...]]:
    """Index of an example and the figures of its denoised layers, or why it cannot be planned or rendered."""
    activate(job.backend, job.threads)
    planner = planner_of(job)
    try:
        plan = planner.example(ref)
        mesh_root = planner.loaded.path.parent
        asked = [_layers(as_asked(plan, repeat), mesh_root, job) for repeat in range(REPEATS)]
        reference = _layers(converged(plan), mesh_root, job)
    except UserError as error:
        if isinstance(error, OutputError):
            raise
        return ref.index, {}, error.problems
    if not _found_by_all(asked, reference).any():
        rule = "expected pixels that the object covers in every render, got none"
        return ref.index, {}, (Problem(where=f"example {ref.index}", path="image", rule=rule),)
    return ref.index, {name: compare(name, asked, reference) for name in plan.render.denoise}, ()


def as_asked(plan: ExamplePlan, repeat: int) -> ExamplePlan:
    """The dataset's own way to render its denoised layers, their raw twins beside them, under a seed of its own."""
    layers = tuple((name + suffix, extent) for name, extent in plan.render.layers if name in plan.render.denoise
                   for suffix in ("", "_raw", "_se"))
    return _changed(plan, f"repeat {repeat}", layers=(*layers, ("mask", "object")))


def converged(plan: ExamplePlan) -> ExamplePlan:
    """As the dataset renders, raw and with `FACTOR` times the spp, on the object, under a seed of its own."""
    render, on_object = plan.render, {"extent": "object"}
    layers = tuple((name + suffix, "object") for name in render.denoise for suffix in ("", "_se"))
    goals = tuple(GoalPlan(layer=goal.layer, error=goal.error / math.sqrt(FACTOR), seconds=goal.seconds * FACTOR,
                           cap=goal.cap * FACTOR) for goal in render.goals)
    spp = {name: getattr(render, name) * FACTOR for name in ("spp_source", "spp_target", "spp_rough")}
    passes = tuple(entry.model_copy(update=on_object) for entry in plan.effects.passes)
    smaller = plan.model_copy(update={"effects": plan.effects.model_copy(update={"passes": passes})})
    return _changed(smaller, "reference", layers=(*layers, ("mask", "object")), denoise=(), goals=goals,
                    spp_parts=(), **spp)


def _changed(plan: ExamplePlan, name: str, **changed: object) -> ExamplePlan:
    seed = str(derive_seed(int(plan.render.seed), "denoised", name))
    render = plan.render.model_copy(update={"seed": seed, "keep_raw": False, **changed})
    return plan.model_copy(update={"render": render})


def _layers(plan: ExamplePlan, mesh_root: Path, job: BuildJob) -> Images:
    # Verbs that render nothing import this module, too; they need not wait for Mitsuba
    from dataset_builder.rendering.examples import render_view

    example, = render_view([plan], mesh_root, fields=job.fields)
    return example.layers


def compare(name: str, asked: Sequence[Images], reference: Images) -> Figures:
    """Figures of one layer on the object. asked: independent renders with `name`, its `_raw` and `_se`.

    Renders with few camera rays differ in what they find of the outline, and a layer is 0 where its own mask is: the
    pixels are those that all of them find.
    With a and b two such renders and r the reference, E[(a - r)(b - r)] is bias^2 plus the reference's variance: the
    noise of a and b is independent and falls out. Nothing is known of a layer whose reference is black: NaN.
    """
    inside = _found_by_all(asked, reference)
    expected, noise = (reference[key][inside].astype(np.float64) for key in (name, f"{name}_se"))
    off = [images[name][inside] - expected for images in asked]
    raw = [images[f"{name}_raw"][inside] - expected for images in asked]
    weight, mean = 1 / (expected**2 + DARK), float(expected.mean()) or math.nan
    own = float((noise**2 * weight).mean())
    # The reference's noise is in its weight, too: E[e^2 f(e)] = v E[f] + v^2 E[f''] (Stein's lemma, v its variance)
    product = (math.prod(off[:2]) - noise**2) * weight - noise**4 * (6 * expected**2 - 2 * DARK) * weight**3
    variance = _of_mean(noise) + sum(_of_mean(images[f"{name}_se"][inside]) for images in asked) / len(asked)**2
    return Figures(
        bias=float(np.mean(off)) / mean, bias_error=variance / mean**2, relmse_reference=own,
        pixel_bias=float(product.mean()), pixel_bias_error=_of_blocks(product.mean(axis=1), inside),
        relmse_raw=float(np.mean([x**2 * weight for x in raw])),
        relmse_denoised=float(np.mean([x**2 * weight for x in off])))


def _found_by_all(asked: Sequence[Images], reference: Images) -> np.ndarray:
    return np.all([images["mask"][..., 0] > 0 for images in (*asked, reference)], axis=0)


def _of_mean(error: np.ndarray) -> float:
    """Variance of the mean of (P, 3) values with these standard errors: pixels are independent, channels are not."""
    return float((error.mean(axis=1, dtype=np.float64) ** 2).sum()) / len(error) ** 2


def _of_blocks(values: np.ndarray, inside: np.ndarray) -> float:
    """Variance of the mean of (P,) values of the pixels of a (H, W) mask, from how blocks of pixels differ: what a
    filter leaves in neighbours is no independent error. Infinite with fewer than `LEAST_BLOCKS`."""
    row, column = (place // BLOCK for place in np.nonzero(inside))
    _, block = np.unique(row * inside.shape[1] + column, return_inverse=True)
    count = int(block.max()) + 1
    if count < LEAST_BLOCKS:
        return math.inf
    sums = np.bincount(block, weights=values - values.mean(), minlength=count)
    return float((sums**2).sum()) / len(values)**2 * count / (count - 1)


def _combined(name: str, measured: Sequence[Figures]) -> Denoised:
    """Mean over the examples of which anything is known, to six digits."""
    examples = [figures for figures in measured if figures.known]
    if not examples:
        return Denoised(layer=name, bias=0.0, bias_error=0.0, pixel_bias=0.0, relmse_raw=0.0, relmse_denoised=0.0,
                        relmse_reference=0.0, examples=0, known="unknown")

    def mean(key: str) -> float:
        return sum(getattr(figures, key) for figures in examples) / len(examples)
    squared, margin = mean("pixel_bias"), SURE * math.sqrt(mean("pixel_bias_error") / len(examples))
    if not math.isfinite(margin):
        # What is left in each render is bias and noise: both together are a bound
        squared, margin = 0.0, mean("relmse_denoised")
    hidden = squared <= margin
    return Denoised(
        layer=name, bias=_rounded(mean("bias")), bias_error=_rounded(math.sqrt(mean("bias_error") / len(examples))),
        pixel_bias=_rounded(math.sqrt(max(squared, 0.0) + (margin if hidden else 0.0))),
        relmse_raw=_rounded(mean("relmse_raw")), relmse_denoised=_rounded(mean("relmse_denoised")),
        relmse_reference=_rounded(mean("relmse_reference")), examples=len(examples),
        known="at most" if hidden else "measured")


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
