"""What a build would run again where results that finished examples share with others are lost."""

import shutil
from collections import Counter
from pathlib import Path

from dataset_builder.builder import build
from dataset_builder.engine.against import FIELD, against
from dataset_builder.engine.unit import BuildJob
from dataset_builder.planning.plan import Planner
from dataset_builder.rendering.pass_inputs import RUNS
from dataset_builder.spec.load import load_dataset
from tests.small_specs import write_spec

SPEC = """\
name: small
image: {width: 12, height: 10}
layers: {i_s: object, mask: object, s_prime: object}
render: {spp: 4, max_depth: 3}
rough: {sigma: [0.006], edge_length: 0.4, rounds: 0}
gates: {mask_overlap: 0}
splits:
  - name: train
    objects: {count: 1, from: [objects/ottoman.yaml]}
    scenes: {count: 1, from: [scenes/den.yaml]}
    source: {kind: field, gives: [i_s], views: 8, held_out: 1, size: 16, spp: 4, resolution: 32, steps: 10,
             gates: {psnr: 0, opacity_iou: 0}}
"""
MORE = ["rough.sigma=[0.006, 0.01]"]


def test_what_new_examples_share_with_kept_ones_is_counted(tmp_path: Path) -> None:
    spec, folder = write_spec(tmp_path, {"small.yaml": SPEC}), tmp_path / "out"
    list(build(load_dataset(spec), folder, backend="llvm", workers=1))
    for kept in ("passes", "fields"):
        shutil.rmtree(folder / ".build" / kept, ignore_errors=True)
    loaded = load_dataset(spec, MORE)
    said = against(Planner(loaded), folder, BuildJob.of(loaded, folder, backend="llvm", threads=1))
    assert said.kept == 1 and said.examples == 2
    events = list(build(loaded, folder, backend="llvm", workers=1))
    ran = Counter(name for event in events for outcome in event.outcomes for name in outcome.seconds
                  if name in RUNS)
    fields = sum(bool(event.field and event.field.seconds) for event in events)
    assert fields == 1 == said.passes[FIELD].runs and ran["source"] == 1
    assert {name: each.runs for name, each in said.passes.items() if name != FIELD} == {
        name: ran[name] for name in said.passes if name != FIELD}
