"""What a dataset will cost: passes, pixels, paths, seconds and bytes, by arithmetic on plans; nothing is rendered."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, field, fields
from math import sqrt
from statistics import fmean

import numpy as np

from dataset_builder.errors import PlanError, Problem
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.layers import LAYERS, Extent
from dataset_builder.planning.catalogue import ExampleRef, ViewRef, count_examples, shard_size, views_of
from dataset_builder.planning.effects.decisions import FACTOR, REPEATS
from dataset_builder.planning.effects.pass_extents import has_direct
from dataset_builder.planning.field_cost import FieldCost, Known, field_cost
from dataset_builder.planning.field_recipe import ABOUT_FIELDS
from dataset_builder.planning.pass_work import (
    RUNS,
    Rates,
    expected_spp,
    files_per_example,
    pass_runs,
    pass_share,
)
from dataset_builder.planning.plan import Planner, first_plan, layers_asked
from dataset_builder.planning.precheck import read_meshes
from dataset_builder.planning.view.cameras import narrow_views
from dataset_builder.planning.view.visibility import window_share
from dataset_builder.seeding import rng
from dataset_builder.spec.dataset import DatasetSpec, SplitSpec

CHANNEL_BYTES = {"float32": 4, "float16": 2}
DIRECT_SHARE = 0.4
"""Time of the direct light that a denoised S' needs, over that of S' itself."""


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Totals; a pass is a launch, bytes are those stored."""

    passes: float = 0.0
    pixels: float = 0.0
    """Traced, summed over passes."""
    paths: float = 0.0
    """Pixels times spp."""
    seconds: float = 0.0
    bytes: float = 0.0

    @classmethod
    def of(cls, values: np.ndarray) -> "Cost":
        """From the five figures (5,) in order."""
        return cls(**dict(zip([field.name for field in fields(cls)], values.tolist(), strict=True)))


@dataclass(frozen=True, kw_only=True)
class CostEstimate:
    """Cost of a dataset, its standard error from the views that were planned (0 where all were), and its sizes; views
    that cannot be planned are taken to cost what the others do, so that the estimate is on the safe side."""

    total: Cost
    error: Cost
    examples: int
    views: int
    tried: int
    """Views that planning tried."""
    planned: int
    """Those that can be."""
    problems: tuple[Problem, ...]
    """Why the others cannot."""
    runs: Mapping[str, int]
    """Launches of each pass for the examples themselves."""
    warnings: tuple[str, ...] = ()
    """What a dataset is better without, one sentence each."""
    files: Mapping[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)
    """Of every mesh file, pairs of a word and a sentence: what it contains, and what became of it."""
    traced: Mapping[str, float] = field(default_factory=dict)
    """Pixels that the launches of each pass trace, as in `total.pixels`."""
    field_cost: FieldCost = field(default_factory=FieldCost)
    """Of fields, whose seconds are in `total`."""


def stored_bytes(layers: Iterable[tuple[str, Extent]], frame: int, coverage: float, dtype: str, rates: Rates,
                 files: Mapping[str, float]) -> float:
    """Stored bytes of one example: values where a layer has them, next to nothing elsewhere, and its record. frame:
    pixels of an image; coverage: share of them that the object covers; files: of each layer, per example."""
    total = rates.example_bytes
    for name, extent in layers:
        full = 1.0 if extent == "frame" else coverage
        share = full * rates.kept_share + (1 - full) * rates.empty_share
        total += frame * LAYERS[name].channels * CHANNEL_BYTES[dtype] * share * files[name]
    return total


def expected_bytes(spec: DatasetSpec, count: int, staged: int = 0) -> int:
    """Stored bytes of `count` examples in shards and of `staged`, which share no files, before any is planned, the
    object in the middle of the coverage asked for."""
    frame, layers = spec.image.width * spec.image.height, layers_asked(spec)
    coverage = max(sum(spec.camera_of(split.name).coverage) for split in spec.splits) / 2
    most = {name: max(_files(spec, split)[name] for split in spec.splits) for name, _ in layers}
    return round(sum(number * stored_bytes(layers, frame, coverage, spec.storage.dtype, Rates(), files)
                     for number, files in ((count, most), (staged, dict.fromkeys(most, 1.0)))))


def _files(spec: DatasetSpec, split: SplitSpec) -> dict[str, float]:
    """Files of each layer per example of a split."""
    per_shard = shard_size(spec, count_examples(spec, split)) if spec.storage.shared == "once" else 1
    return {name: files_per_example(name, spec.target.count_of(split.lights), len(split.levels(spec.rough)), per_shard)
            for name, _ in layers_asked(spec)}


def view_cost(plan: ExamplePlan, lights: int, levels: int, window: float, dtype: str, rates: Rates,
              cores: int = 1, files: Mapping[str, float] | None = None) -> Cost:
    """Cost of the `lights` x `levels` examples of the view that `plan` belongs to.

    window: share of the frame in the rectangle about the object; files: of each layer, per example, one unless given.
    Views are independent, so they share the cores evenly.
    """
    frame, examples = plan.render.width * plan.render.height, lights * levels
    seconds, pixels, paths = rates.seconds_per_view + rates.seconds_per_example * examples, 0.0, 0.0
    runs = pass_runs(plan.render.layers, lights, levels)
    for name, traced in view_pixels(plan, lights, levels, window).items():
        once = pass_share(name, plan, window) * frame
        rate, noise = rates.of(plan, name)
        pixels += traced
        spp = expected_spp(plan.render, name, noise, rate / max(once, 1))
        paths += traced * spp
        again = DIRECT_SHARE if name == "rough" and has_direct(plan.render) else 0.0
        seconds += traced * spp * (1 + again) / rate
    passes = sum(runs.values())
    stored = stored_bytes(plan.render.layers, frame, plan.camera.coverage, dtype, rates,
                          files or {name: 1.0 for name, _ in plan.render.layers})
    return Cost(passes=passes, pixels=pixels, paths=paths, bytes=examples * stored,
                seconds=(seconds + passes * rates.seconds_per_pass) / cores)


def view_pixels(plan: ExamplePlan, lights: int, levels: int, window: float) -> dict[str, float]:
    """Pixels that every pass traces for the `lights` x `levels` examples of a view; window: as `view_cost` has it."""
    frame = plan.render.width * plan.render.height
    return {name: times * pass_share(name, plan, window) * frame
            for name, times in pass_runs(plan.render.layers, lights, levels).items()}


def calibration_cost(planner: Planner, rates: Rates, cores: int = 1) -> Cost:
    """Cost of measuring how far denoised layers may be trusted, from the first example that can be planned.

    Every example that is measured is rendered `REPEATS` times as asked, and once with `FACTOR` times the spp.
    """
    spec, denoise = planner.loaded.dataset, planner.loaded.dataset.render.denoise
    plan = first_plan(planner) if denoise.layers else None
    if plan is None:
        return Cost()
    layers = tuple((name, extent) for name, extent in plan.render.layers if name in denoise.layers)
    plan = plan.model_copy(update={"render": plan.render.model_copy(update={"layers": layers})})
    count = min(denoise.examples, sum(len(views_of(spec, split)) for split in spec.splits))
    window = window_share(planner.view(planner.examples[plan.index].view).arrangement,
                          Pinhole.of(plan.camera, spec.image.width, spec.image.height))
    one = view_cost(plan, 1, 1, window, spec.storage.dtype, rates, min(cores, count))
    renders, times = count * (REPEATS + 1), count * (REPEATS + FACTOR)
    return Cost(passes=renders * one.passes, pixels=renders * one.pixels, paths=times * one.paths,
                seconds=times * one.seconds)


def extrapolate(costs: Sequence[Cost], views: int) -> tuple[Cost, Cost]:
    """Total over `views` views, and its standard error, from the costs of some of them drawn without replacement.

    Cochran, Sampling Techniques, 3rd ed., eq. 2.20: N sqrt((1 - n/N) s^2 / n). One view says nothing about the spread:
    its error is given as 0.
    """
    table = np.array([astuple(cost) for cost in costs])
    count = len(table)
    spread = table.std(axis=0, ddof=1) if count > 1 else np.zeros(table.shape[1])
    return Cost.of(views * table.mean(axis=0)), Cost.of(views * spread * sqrt(max(1 - count / views, 0.0) / count))


def _chosen(spec: DatasetSpec, views: Sequence[ViewRef], share: float) -> list[ViewRef]:
    """Views of one split drawn without replacement, at least two where there are two."""
    count = min(max(round(share * len(views)), 2), len(views))
    picked = rng(spec.seed, views[0].pair.split, "cost").choice(len(views), count, replace=False)
    return [views[k] for k in sorted(picked)]


def _split_cost(planner: Planner, views: Sequence[ViewRef], split: SplitSpec, rates: Rates,
                cores: int) -> tuple[list[tuple[ExamplePlan, Cost, dict[str, float]]], list[Problem]]:
    """Plan, cost and `view_pixels` of each of some views of one split under their first light, and why others cannot be
    planned."""
    spec = planner.loaded.dataset
    costs, problems = list[tuple[ExamplePlan, Cost, dict[str, float]]](), list[Problem]()
    lights, levels = spec.target.count_of(split.lights), len(split.levels(spec.rough))
    for ref in views:
        try:
            plan = planner.example(ExampleRef(index=0, view=ref, light=0, level=0))
        except PlanError as error:
            problems += error.problems
            continue
        window = window_share(planner.view(ref).arrangement,
                              Pinhole.of(plan.camera, spec.image.width, spec.image.height))
        costs.append((plan, view_cost(plan, lights, levels, window, spec.storage.dtype, rates, cores,
                                      _files(spec, split)), view_pixels(plan, lights, levels, window)))
    if not costs:
        raise PlanError(dict.fromkeys(problems))
    return costs, problems


def estimate(planner: Planner, views: int = 24, rates: Rates | None = None, cores: int = 1,
             known: Known = lambda *_: False) -> CostEstimate:
    """Cost of the whole dataset, of fields that it needs, and of the measuring that precedes it where it is denoised.
    known: which fields were made already.

    From about `views` views, drawn in every split in proportion and planned for real. Views that cannot be planned are
    passed over and counted. More cores than views are idle. Raises PlanError where splits share an object or a scene,
    with all that is wrong with mesh files, and where none of the views tried in a split can be planned.
    """
    spec, files = planner.loaded.dataset, read_meshes(planner)
    total, variance, tried, planned, runs = np.zeros(5), np.zeros(5), 0, list[ExamplePlan](), dict.fromkeys(RUNS, 0)
    problems, traced = list[Problem](), dict.fromkeys(RUNS, 0.0)
    all_views = [views_of(spec, split) for split in spec.splits]
    count = sum(map(len, all_views))
    cores = min(cores, count)
    for split, own in zip(spec.splits, all_views, strict=True):
        chosen = _chosen(spec, own, views / count)
        costs, failed = _split_cost(planner, chosen, split, rates or Rates(), cores)
        problems += failed
        whole, error = extrapolate([cost for _, cost, _ in costs], len(own))
        total, variance = total + astuple(whole), variance + np.square(astuple(error))
        tried, planned = tried + len(chosen), planned + [plan for plan, _, _ in costs]
        for name in RUNS:
            traced[name] += len(own) * fmean(pixels[name] for *_, pixels in costs)
        times_of = pass_runs(layers_asked(spec), spec.target.count_of(split.lights), len(split.levels(spec.rough)))
        for name, times in times_of.items():
            runs[name] += times * len(own)
    made = field_cost(planner, known, rates or Rates(), cores)
    total += astuple(calibration_cost(planner, rates or Rates(), cores)) + np.array([0, 0, 0, made.seconds, 0])
    about = dict.fromkeys(f"{plan.target.object.name}: {note.removeprefix(ABOUT_FIELDS)}" for plan in planned
                          for note in plan.notes if note.startswith(ABOUT_FIELDS))
    return CostEstimate(total=Cost.of(total), views=count, error=Cost.of(np.sqrt(variance)), tried=tried, runs=runs,
                        examples=count_examples(spec), planned=len(planned), traced=traced, files=files.told,
                        field_cost=made, warnings=(*files.warnings, *narrow_views(planned), *about),
                        problems=tuple(dict.fromkeys(problems)))
