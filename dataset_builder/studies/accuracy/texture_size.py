"""Question 6: how many texels D and I_t need.

Both pictures follow the same random numbers, so that their difference is that of the textures; it has no noise in D and
next to none in I_t.
"""

from collections.abc import Iterator
from dataclasses import replace

from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.studies.accuracy.depth import relative_difference
from dataset_builder.studies.accuracy.rows import AccuracyRow
from dataset_builder.studies.accuracy.workbench import Bench, kept
from dataset_builder.studies.timing import seconds_of

TEXTURES = "texture-size"
LAYERS = {"d": "object", "i_t": "object"}


def measure(bench: Bench, ref: ExampleRef) -> Iterator[AccuracyRow]:
    """D and I_t of every texture size against the dataset's own."""
    own = bench.spec.dataset.render.texture_size
    full = bench.timed(TEXTURES, bench.plan(ref, bench.spp(bench.budget.passes), layers=LAYERS))
    for size in [size for size in bench.budget.textures if size < own]:
        plan = bench.plan(ref, bench.spp(bench.budget.passes), f"render.texture_size={size}", layers=LAYERS)
        found = bench.timed(TEXTURES, plan)
        for row in bench.compared(TEXTURES, f"{size} texels", size, found, full.layers, LAYERS):
            difference = relative_difference(found.layers[row.layer], full.layers[row.layer],
                                             kept(found, full.layers, row.layer))
            yield replace(row, bias=difference, seconds=seconds_of(row.layer, found))
