"""Are the layers of a dataset consistent? Statistics over examples find errors that ranges and hashes cannot.

`identities.py` checks exact rules in every example. A layer under a gamma, a mask beside its object or S' of another
example break none of them. Physics leaves traces that hundreds of noisy cells together show clearly; each check here is
a statistic over the whole dataset with bounds that sound datasets keep with room to spare.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dataset_builder.errors import UserError
from dataset_builder.label.example_label import RenderRecord
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.layers import PAPER_LAYERS
from dataset_builder.lightnet.data.truth import problem_of
from dataset_builder.release import light_checks, shape_checks
from dataset_builder.release.cells import Cells, cells_of
from dataset_builder.release.dataset_check import Check, Rule
from dataset_builder.release.shape_checks import Outline, SurfaceFacts, outline_of, surface_of
from dataset_builder.remote.address import title_of
from dataset_builder.shards.reader import load_manifest, open_dataset
from dataset_builder.spread import spread_indices

HELPFUL = ("mask_rough", "air", "depth", "normal", "i_s_clean")
"""Layers that checks use where a dataset has them."""
EXAMPLES = 512
"""Most examples that statistics are taken over; more would not make them surer."""
RULES: tuple[Rule, ...] = (*light_checks.RULES, *shape_checks.RULES)


@dataclass(frozen=True, kw_only=True, eq=False)
class Facts:
    """What is kept of one example."""

    cells: Cells
    outline: Outline
    surface: SurfaceFacts


def facts(layers: Mapping[str, np.ndarray], plan: ExamplePlan, record: RenderRecord) -> Facts:
    """An example, its layers by name and what its label says, reduced to what the checks need.

    Where `i_s` is the image of a field, `i_s_clean` takes its place; without it, nothing is said of the source light.
    """
    rendered = not plan.field.there or "i_s_clean" in layers
    layers = {**layers, "i_s": layers.get("i_s_clean", layers["i_s"])}
    cells = cells_of(plan.key, layers, fog=plan.fog.extinction > 0, rendered=rendered)
    return Facts(cells=cells, outline=outline_of(plan.key, layers),
                 surface=surface_of(layers, plan, record))


def check_facts(found: Iterable[Facts]) -> list[Check]:
    """Every rule, in the order of `RULES`, over the facts of a dataset's examples.

    Examples in fog without the layer `air` count for outlines and surfaces alone: their light cannot be told apart.
    """
    found = list(found)
    return [*light_checks.light_checks([one.cells for one in found]),
            *shape_checks.outline_checks([one.outline for one in found]),
            *shape_checks.surface_checks([one.surface for one in found])]


def read_facts(folder: Path | str, examples: int = EXAMPLES) -> Iterator[Facts]:
    """Facts of at most `examples` examples of a finished dataset, spread evenly over its splits, one after the other.

    No more than one example's pixels are in memory at a time. Raises ShardError where the dataset cannot be read, and
    UserError where it misses a layer of the paper's tuple.
    """
    known = {layer.name for layer in load_manifest(folder).layers}
    if lacking := problem_of(title_of(folder), known, PAPER_LAYERS, "hold against each other"):
        raise UserError([lacking])
    dataset = open_dataset(folder, layers=[*PAPER_LAYERS, *(name for name in HELPFUL if name in known)])
    keys = [key for split in dataset.splits.values() for key in split]
    for place in spread_indices(len(keys), examples):
        label = dataset.label(keys[place])
        layers = {name: image.pixels for name, image in dataset.images(label.key)}
        yield facts(layers, label.plan, label.record)
