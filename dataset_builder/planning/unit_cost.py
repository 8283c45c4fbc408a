"""What a view is expected to take, from the spec alone: the same figure on every machine, and before any is planned."""

from itertools import product

from dataset_builder.label.example_plan import RenderPlan
from dataset_builder.planning.catalogue import ExampleRef, PairRef, ViewRef, ViewUnit
from dataset_builder.planning.pass_work import INSTANCE, Rates, expected_spp, pass_of, pass_runs
from dataset_builder.planning.plan import render_plan
from dataset_builder.spec.dataset import DatasetSpec


def unit_seconds(spec: DatasetSpec, unit: ViewUnit, rates: Rates | None = None) -> float:
    """Seconds of one core for some examples of a view, the object in the middle of the coverage asked for."""
    rates, split = rates or Rates(), unit.view.pair.split
    render, pixels = render_plan(spec, unit.view), spec.image.width * spec.image.height
    coverage = sum(spec.camera_of(split).coverage) / 2
    seconds = rates.seconds_per_view + rates.seconds_per_example * len(unit.examples)
    for name, times in pass_runs(render.layers, len(unit.lights), len(unit.levels)).items():
        rate = rates.free_paths if name.startswith(("first_hit", INSTANCE)) else rates.light_paths / rates.joined_time
        traced = pixels * (1.0 if _on_frame(render, name) else coverage)
        paths = traced * expected_spp(render, name, rates.noise, rate / max(traced, 1))
        seconds += times * (rates.seconds_per_pass + paths / rate)
    return seconds


def example_seconds(spec: DatasetSpec, split: str) -> float:
    """Seconds of one core for an example of a split, all of whose views have as many lights and levels."""
    found = spec.split_of(split)
    view = ViewRef(number=0, pair=PairRef(split=split, object=0, scene=0), camera=0)
    every = product(range(spec.target.count_of(found.lights)), range(len(found.levels(spec.rough))))
    unit = ViewUnit(view=view, examples=tuple(ExampleRef(index=number, view=view, light=light, level=level)
                                              for number, (light, level) in enumerate(every)))
    return unit_seconds(spec, unit) / len(unit.examples)


def _on_frame(render: RenderPlan, name: str) -> bool:
    return any(extent == "frame" and pass_of(layer) == name for layer, extent in render.layers)
