"""Examples of a dataset, exported as stages, read back and rendered: the same pictures, within noise?

    python benchmarks/round_trip.py DATASET [KEY ...] --meshes FOLDER

The stage becomes a scene of a dataset of its own: its target is the thing /Example/Target, its lights are kept as they
are, its camera is its own. Both are rendered with `--seeds` seeds each, none of them twice. Welch's t-test compares
every block of 4 x 4 pixels; with all blocks and channels of a layer together, equal pictures fail once in 1000. What
needs no light has no error to speak of but at edges: the share of pixels that differ is printed. Only what the stage
says comes back: sheen, glass, fog and the like, which the export names, make pictures differ.
"""

import argparse
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import stats

from dataset_builder.exporting.export_usd import ExportJob, export_usd
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.plan import plan_example
from dataset_builder.rendering import plugins
from dataset_builder.rendering.backend import activate
from dataset_builder.rendering.examples import render_view
from dataset_builder.shards.reader import open_dataset
from dataset_builder.spec.load import load_dataset

SCENE = """file:
  path: stage/scene.usdc
  licence: CC0-1.0
  lights: {use: kept, scale: 1}
  cameras: own
"""
DATASET = """name: back
seed: 77
camera: {coverage: [0.0001, 1], visibility: 0.01, clearance: 0}
target: {brightness: [0, 1000000]}
splits:
  - name: train
    objects: {count: 1, things: {name: /Example/Target}}
    scenes: {count: 1, from: [scene.yaml]}
"""
LIT, UNLIT = ("i_t", "s"), ("d", "r", "depth", "mask")
LAYERS = tuple((name, "frame") for name in (*LIT, *UNLIT))
BLOCK = 4
FAILURES = 1e-3
"""That a layer of equal pictures fails by chance."""
EDGE = 1e-3
"""Difference from which a pixel of an unlit layer counts as another."""


@dataclass(frozen=True, kw_only=True)
class LayerVerdict:
    """One layer of one example."""

    layer: str
    ratio: float
    """Mean read back over mean exported."""
    p: float
    """Least of all blocks, times their number."""


def read_back(stage: Path, plan: ExamplePlan) -> ExamplePlan:
    """The plan of the one example of a stage `FOLDER/stage/scene.usdc`, for the same layers and path length."""
    folder, render = stage.parent.parent, plan.render
    (folder / "scene.yaml").write_text(SCENE)
    (folder / "back.yaml").write_text(DATASET)
    depth = plan.effects.of("target").max_depth
    given = (f"image={{width: {render.width}, height: {render.height}}}", f"render.max_depth={depth}",
             f"render.spp={render.spp_target}", "layers={i_t: frame}")
    return with_layers(plan_example(load_dataset(folder / "back.yaml", given), 0))


def with_layers(plan: ExamplePlan) -> ExamplePlan:
    """The plan for the layers that are compared, without goals."""
    passes = tuple(entry.model_copy(update={"extent": "frame"}) for entry in plan.effects.passes)
    return plan.model_copy(update={"render": plan.render.model_copy(update={"layers": LAYERS, "goals": (),
                                                                            "denoise": ()}),
                                   "effects": plan.effects.model_copy(update={"passes": passes})})


def pictures(plan: ExamplePlan, root: Path, seeds: range) -> dict[str, np.ndarray]:
    """Layers by name, (seeds, H, W, C) each."""
    found = []
    for seed in seeds:
        own = plan.model_copy(update={"render": plan.render.model_copy(update={"seed": str(seed)})})
        example, = render_view([own], root)
        found.append(example.layers)
    return {name: np.stack([layers[name] for layers in found]).astype(float) for name, _ in LAYERS}


def verdict(layer: str, first: np.ndarray, second: np.ndarray) -> LayerVerdict:
    """Welch's t of all blocks that have noise."""
    count, height, width, channels = first.shape
    rows, columns = height // BLOCK, width // BLOCK
    blocks = [each[:, :rows * BLOCK, :columns * BLOCK].reshape(count, rows, BLOCK, columns, BLOCK, channels)
              .mean(axis=(2, 4)) for each in (first, second)]
    noisy = np.minimum(*(each.std(axis=0) for each in blocks)) > 1e-6
    p = stats.ttest_ind(*(each[:, noisy] for each in blocks), axis=0, equal_var=False).pvalue
    return LayerVerdict(layer=layer, ratio=float(second.mean() / first.mean()), p=float(p.min() * p.size))


def round_trip(given: argparse.Namespace, key: str) -> bool:
    """Export, read back, compare and print; whether every layer with light is the same."""
    plan = with_layers(open_dataset(given.dataset).label(key).plan)
    with tempfile.TemporaryDirectory() as folder:
        done = export_usd(ExportJob(dataset=given.dataset, key=key, out=Path(folder) / "stage", mesh_root=given.meshes))
        back = read_back(done.stage, plan)
        first = pictures(plan, given.meshes, range(given.seeds))
        second = pictures(back, Path(folder), range(given.seeds, 2 * given.seeds))
        again = pictures(back, Path(folder), range(1))
    verdicts = [verdict(layer, first[layer], second[layer]) for layer in LIT]
    lost = "; ".join(done.not_said) or "nothing"
    print(f"{key}: {done.things} things, {done.triangles:,} triangles; not said: {lost}")
    for each in verdicts:
        print(f"  {each.layer}: mean read back over exported {each.ratio:.4f}, least p times blocks {each.p:.3g} "
              f"(equal pictures are below {FAILURES:g} once in {1 / FAILURES:.0f})")
    for layer in UNLIT:
        share = float((np.abs(first[layer][0] - again[layer][0]).max(axis=-1) > EDGE).mean())
        print(f"  {layer}: {share:.2%} of pixels differ by more than {EDGE:g}")
    return all(each.p > FAILURES for each in verdicts)


def every_key(dataset: Path) -> list[str]:
    """Of all examples, in order."""
    return [key for keys in open_dataset(dataset).splits.values() for key in keys]


def main() -> int:
    """Exit code 1 where a picture differs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("dataset", type=Path, nargs="?", help="finished dataset")
    parser.add_argument("keys", nargs="*", help="of examples (default: all)")
    parser.add_argument("--meshes", type=Path, default=Path(), help="folder of the dataset's spec (default: here)")
    parser.add_argument("--seeds", type=int, default=16, help="of each side (default 16)")
    parser.add_argument("--threads", type=int, default=2)
    given = parser.parse_args()
    if not given.dataset:
        print("not run: give a finished dataset")
        return 0
    activate("auto", given.threads)
    plugins.register()
    return 0 if all([round_trip(given, key) for key in given.keys or every_key(given.dataset)]) else 1


if __name__ == "__main__":
    sys.exit(main())
