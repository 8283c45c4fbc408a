"""Whether means of layers err as records claim: the same examples many times, with other samples each time.

    python -m benchmarks.means                              two examples of a made room: chrome, lamps of 1 to 10 cm
    python -m benchmarks.means --spec FILE --examples 0 40  of another dataset, at its own spp and size
    python -m benchmarks.means --runs 8 --set 'render.spp=64' --set 'image={width: 32, height: 32}'

Per example and layer, all relative to the mean of all runs, over the pixels that the layer is traced on:

    true     standard deviation of the mean over the runs
    claimed  `mean_error` of the records, median
    pixels   what errors of pixels that are independent would give, median
    unknown  runs whose record calls the mean so; likewise widened and known
    lowest   the lowest mean, in errors of its pixels
    ratio    of runs that call their mean known: root mean square of what they are off by, over that of what they claim

Exit code 1 where the square of a ratio is above the limit of an F distribution, of as many degrees as there are such
runs, less one, and three for what each of them claims: for all layers together that is once in a hundred times if means
are normal and claims right (Bonferroni). Layers of fewer than four such runs are not judged.
"""

import argparse
import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.stats import f

from benchmarks import _common as common
from dataset_builder.label.example_label import LayerAccuracy
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.rendering.examples import ERROR_SUFFIX
from dataset_builder.rendering.passes import RADIANCE_LAYERS
from dataset_builder.studies.renders import render
from dataset_builder.studies.sampled import StudySpec, rerendered, reseeded

CHROME = 'materials: {"*": {plain: true, metallic: 1, roughness: 0.03, base_color: [0.95, 0.95, 0.95]}}\n'
MADE = {
    "chrome.yaml": """\
name: chrome
seed: 12
image: {width: 48, height: 48}
layers: {i_s: frame, i_t: frame, s: frame, s_prime: frame, spec: frame, mask: object, mask_rough: object}
rough: {sigma: 0.004, edge_length: 0.06}
render: {spp: {first_hit: 64, source: 16, target: 16, rough: 16}}
gates: {mask_overlap: 0.1, s_prime_energy: [1e-6, 1e6], coverage: [0.0, 1.0]}
camera: {elevation: {uniform: [5, 40]}, azimuth: {uniform: [-180, 180]}, coverage: [0.05, 0.6]}
source: {dome: 1}
target: {lights: 2, kinds: [sphere, area], size: {log_uniform: [0.01, 0.1]}, strength: 5, dome: 0.05,
         distance: {uniform: [0.8, 2]}, elevation: {uniform: [10, 80]}, brightness: [0.01, 200]}
splits:
  - {name: train, objects: {count: 2, from: [vase.yaml, chair.yaml]}, scenes: {count: 1, from: [scene.yaml]}, pairs: 2}
""",
    "vase.yaml": "family: vase\n" + CHROME,
    "chair.yaml": "family: chair\n" + CHROME,
    "table.yaml": "family: coffee_table\n" + CHROME,
    "wardrobe.yaml": "family: wardrobe\n" + CHROME,
    "room.yaml": "width: 5\ndepth: 4\nheight: 2.6\nwindows: 1\n",
    "scene.yaml": """\
room: room.yaml
furniture:
  - {object: table.yaml, place: near}
  - {object: vase.yaml, place: near, count: 2}
  - {object: wardrobe.yaml, place: wall}
"""}
"""Path in a folder -> what is written there."""
ALARM, FEWEST, DEGREES = 0.01, 4, 3


def made_spec(folder: Path) -> Path:
    """The made room, written to a folder; its dataset file."""
    for name, text in MADE.items():
        (folder / name).write_text(text)
    return folder / "chrome.yaml"


def runs_of(plan: ExamplePlan, root: Path, runs: int) -> dict[str, tuple[np.ndarray, np.ndarray, list[LayerAccuracy]]]:
    """By layer with light: (N,) means of the runs, (N,) standard errors that independent pixels give, records."""
    lit = [(name, extent) for name, extent in plan.render.layers if name in RADIANCE_LAYERS]
    asked = tuple(plan.render.layers) + tuple((name + ERROR_SUFFIX, extent) for name, extent in lit)
    plan, found = rerendered(plan, layers=tuple(dict(asked).items())), {name: ([], [], []) for name, _ in lit}
    for run in range(runs):
        done = render(reseeded(plan, "means", run), root)
        for record in done.record.layers:
            means, alone, records = found[record.name]
            means.append(float(done.layers[record.name].mean(dtype=np.float64)))
            errors = done.layers[record.name + ERROR_SUFFIX].mean(axis=2, dtype=np.float64)
            alone.append(float(np.sqrt(np.sum(errors**2)) / errors.size))
            records.append(record)
    return {name: (np.array(means), np.array(alone), records) for name, (means, alone, records) in found.items()}


def line(means: np.ndarray, alone: np.ndarray, records: list[LayerAccuracy]) -> tuple[str, float, int]:
    """What is printed of one layer, its ratio, and of how many runs."""
    whole, number = float(means.mean()), len(means)
    if not whole:
        return "black", 0.0, 0
    off = (means / whole - 1) * np.sqrt(number / (number - 1))
    claimed, said = np.array([record.mean_error for record in records]), [record.mean_known for record in records]
    known = np.array([name == "known" for name in said])
    ratio = float(np.sqrt(np.mean(off[known] ** 2) / np.mean(claimed[known] ** 2))) if known.any() else 0.0
    count, lowest = Counter(said), int(means.argmin())
    true, told, independent = (100 * value for value in (np.sqrt(np.mean(off**2)), np.median(claimed),
                                                         np.median(alone) / whole))
    text = (f"{true:7.2f} {told:8.2f} {independent:7.2f} {count['unknown']:8} {count['widened']:8} {count['known']:6} "
            f"{(means[lowest] - whole) / alone[lowest] if alone[lowest] else 0:7.1f}")
    return text, ratio, int(known.sum())


def main() -> int:
    """The table; exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spec", type=Path)
    parser.add_argument("--examples", type=int, nargs="+", default=[0, 1])
    parser.add_argument("--runs", type=int, default=12)
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="as `build` takes it")
    given = parser.parse_args()
    common.start()
    judged: list[tuple[str, float, int]] = []
    print(f"{'example and layer, errors in %':32}    true  claimed  pixels  unknown  widened  known  lowest  ratio")
    with TemporaryDirectory() as folder:
        study = StudySpec(path=given.spec or made_spec(Path(folder)), overrides=tuple(given.set))
        for index in given.examples:
            plan = study.plan(study.planner().examples[index])
            for layer, found in runs_of(plan, study.mesh_root, given.runs).items():
                text, ratio, known = line(*found)
                if known >= FEWEST:
                    judged.append((f"{plan.key} {layer}", ratio, known))
                print(f"{plan.key} {layer:23} {text} {f'{ratio:5.2f}' if known else '    -'}", flush=True)
    limits = {known: float(np.sqrt(f.isf(ALARM / len(judged), known - 1, DEGREES * known))) for _, _, known in judged}
    wrong = [f"{name}: {ratio:.2f}, at most {limits[known]:.2f}" for name, ratio, known in judged
             if ratio > limits[known]]
    print("\n".join(["known means err by more than they claim:", *wrong] if wrong else
                    [f"known means of {len(judged)} layers err by no more than they claim"]))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
