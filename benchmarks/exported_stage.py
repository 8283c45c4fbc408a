"""An exported example in Blender beside the dataset's own pictures: does the stage say what was rendered?

    python benchmarks/exported_stage.py DATASET KEY --bpy-python PYTHON --picture FILE.png
    python benchmarks/exported_stage.py DATASET KEY --cache FOLDER        makes the environment in FOLDER/bpy with pip

The example is exported, opened by Blender's own importer in each illumination, and rendered by Cycles as it came in,
but for what `cycles/blender_stage.py` puts right. It prints the mean of Cycles' picture over ours, of `i_s` and of
`i_t`, and the relative error between both where neither has a lamp; the picture has ours on the left.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from cycles.client import make_environment
from cycles.stage_client import StageViewer
from cycles.units import indirect_bounces

from dataset_builder.exporting.export_usd import ExportJob, export_usd
from dataset_builder.shards.reader import open_dataset
from dataset_builder.tonemap import side_by_side

LAYERS = {"i_s": "source", "i_t": "target"}
BOUND = 0.1
"""Largest difference of means that counts as the same light: surfaces and spots are modelled differently."""


def compared(given: argparse.Namespace, python: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Our picture and Cycles' of each layer."""
    dataset = open_dataset(given.dataset)
    example, plan = dataset[given.key], dataset.label(given.key).plan
    found = {}
    with tempfile.TemporaryDirectory() as folder, StageViewer(python, given.threads) as viewer:
        print(f"Blender {viewer.version}")
        done = export_usd(ExportJob(dataset=given.dataset, key=given.key, out=Path(folder) / "stage",
                                    mesh_root=given.meshes))
        for what in done.not_said:
            print(f"not in the stage: {what}")
        for layer, illumination in LAYERS.items():
            if layer not in example:
                continue
            depth = plan.effects.of(illumination).max_depth
            viewer.open(done.stage, illumination=illumination, geometry="3DM", width=plan.render.width,
                        height=plan.render.height, bounces=indirect_bounces(depth))
            found[layer] = example[layer], viewer.picture(given.spp).passes["combined"]
    return found


def difference(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Median over pixels of the difference relative to ours, which noise and lamps in the picture leave alone."""
    level = np.maximum(ours.mean(axis=-1), 0.1 * ours.mean())
    return float(np.median(np.abs(theirs - ours).mean(axis=-1) / level))


def arguments() -> argparse.Namespace:
    """What the command line says."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("dataset", type=Path, nargs="?", help="finished dataset")
    parser.add_argument("key", nargs="?", help="of an example")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--bpy-python", type=Path, help="Python of an environment that has bpy 5")
    where.add_argument("--cache", type=Path, help="folder to keep such an environment in")
    parser.add_argument("--meshes", type=Path, default=Path(), help="folder of the dataset's spec (default: here)")
    parser.add_argument("--spp", type=int, default=256, help="of Cycles' picture (default 256)")
    parser.add_argument("--threads", type=int, default=2, help="of Cycles (default 2)")
    parser.add_argument("--picture", type=Path, help="also draw both here")
    return parser.parse_args()


def main() -> int:
    """Print the figures; exit code 1 where means differ by more than the bound."""
    given = arguments()
    if not given.key or not (given.bpy_python or given.cache):
        print("not run: give a dataset, a key, and --bpy-python PYTHON of an environment with bpy, or --cache FOLDER "
              "to make one in")
        return 0
    found = compared(given, given.bpy_python or make_environment(given.cache / "bpy"))
    ratios = {}
    for layer, (ours, theirs) in found.items():
        ratios[layer] = float(theirs.mean() / ours.mean())
        print(f"{layer}: mean of Cycles' picture over ours {ratios[layer]:.3f} (bound 1 +- {BOUND:g}), median "
              f"difference of a pixel {difference(ours, theirs):.3f}")
    if given.picture:
        from PIL import Image

        Image.fromarray(np.concatenate([side_by_side(pair) for pair in found.values()])).save(given.picture)
    return 0 if all(abs(ratio - 1) <= BOUND for ratio in ratios.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
