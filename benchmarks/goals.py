"""Whether sampling that stops at a goal has the error asked for: "stopped: error" against references.

    python -m benchmarks.goals                          three datasets, 24x24, goals of 0.3 and 0.15
    python -m benchmarks.goals --spec FILE --examples 2 --goals 0.2 --runs 8

Per layer with a goal, over the goal:

    claimed  `relative_error_95` of the records, mean over the runs
    reached  the same, times what pixels are off by (root mean square of relative errors, by the reference and less its
             own noise) over what records claim of that; and its standard error over the runs. Hidden, and not judged,
             where the reference's own noise makes more than half of that in some run (take a larger `--reference`)

Exit code 1 where of all layers that stopped at their error more than one in twenty are above 1.05 times their goal,
each by what Student's t exceeds once in a hundred times: if twenty are just there, that is once in 60. Examples whose
source image is a field's are left out: that takes minutes.
"""

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.stats import t

from benchmarks import _common as common
from dataset_builder.label.example_label import LayerAccuracy
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.rendering.examples import ERROR_SUFFIX
from dataset_builder.rendering.sampling.moments import relative, root_mean_square
from dataset_builder.studies.renders import render
from dataset_builder.studies.sampled import StudySpec, rerendered, reseeded

SPECS = tuple(common.ROOT / "scene_specs" / f"3df-lighting-{name}.yaml" for name in ("effects", "128", "360"))
LAYERS = ("i_s", "i_t", "s_prime")
ALLOWED, SHARE, ALARM = 1.05, 0.05, 0.01


def examples_of(study: StudySpec, count: int) -> Iterator[ExampleRef]:
    """Some that can be planned, spread over the dataset, none with a field."""
    return (ref for ref in study.sample(count) if not study.plan(ref).field.there)


Found = tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, LayerAccuracy]]


def rendered(plan: ExamplePlan, root: Path) -> Found:
    """By layer: (P, C) values of all pixels, their errors, and the entry of the record."""
    done = render(plan, root)
    values, errors = ({name: done.layers[name + suffix].reshape(-1, 3).astype(np.float64) for name in LAYERS}
                      for suffix in ("", ERROR_SUFFIX))
    return values, errors, {record.name: record for record in done.record.layers}


def compared(study: StudySpec, ref: ExampleRef, goal: float, given: argparse.Namespace) -> list[tuple[bool, bool]]:
    """Print a line for each layer; whether it stopped at its error in every run and shows it, and whether that is above
    the goal."""
    layers = tuple((name + suffix, extent) for name, extent in study.plan(ref).render.layers if name in LAYERS
                   for suffix in ("", ERROR_SUFFIX))
    settings = f"image={{width: {given.size}, height: {given.size}}}", "render.spp=16"
    asked = ", ".join(f"{name}: {{error: {goal}, cap: {given.cap}}}" for name in LAYERS)
    adaptive = rerendered(study.plan(ref, *settings, f"render.accuracy={{{asked}}}"), layers=layers)
    fixed = rerendered(study.plan(ref, settings[0], f"render.spp={given.reference}"), layers=layers)
    truth, doubt, _ = rendered(reseeded(fixed, "reference"), study.mesh_root)
    claimed, ratios, stopped, hidden = (defaultdict[str, list](list) for _ in range(4))
    for run in range(given.runs):
        found, errors, records = rendered(reseeded(adaptive, "goals", run), study.mesh_root)
        for name in LAYERS:
            inside = (errors[name] > 0).any(axis=1)
            own, off = (root_mean_square(relative(truth[name][inside], values[inside]))
                        for values in (doubt[name], found[name] - truth[name]))
            told = root_mean_square(relative(found[name][inside], errors[name][inside]))
            hidden[name].append(own**2 > off**2 / 2)
            ratios[name].append(np.sqrt(max(off**2 - own**2, 0)) / told)
            claimed[name].append(records[name].relative_error_95 / goal)
            stopped[name].append(records[name].stopped)
    verdicts = []
    for name in LAYERS:
        reached = np.mean(claimed[name]) * np.array(ratios[name])
        error = float(reached.std(ddof=1) / np.sqrt(given.runs))
        ended = set(stopped[name]) == {"error"} and not any(hidden[name])
        verdicts.append((ended, bool(reached.mean() > ALLOWED + t.isf(ALARM, given.runs - 1) * error)))
        print(f"{study.dataset.name:22} {ref.key} {goal:5.2f} {name:8} {np.mean(claimed[name]):7.3f} "
              + ("  hidden         " if any(hidden[name]) else f"{reached.mean():8.3f} ± {error:.3f} ")
              + f" {', '.join(sorted(set(stopped[name])))}", flush=True)
    return verdicts


def main() -> int:
    """The table; exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spec", type=Path, action="append")
    parser.add_argument("--examples", type=int, default=2, help="of each dataset")
    parser.add_argument("--goals", type=float, nargs="+", default=[0.3, 0.15])
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--size", type=int, default=24)
    parser.add_argument("--cap", type=int, default=4096)
    parser.add_argument("--reference", type=int, default=2048)
    given = parser.parse_args()
    common.start()
    print(f"{'dataset':22} example   goal layer    claimed  reached          stopped")
    verdicts = [verdict for spec in given.spec or SPECS for study in [StudySpec(path=spec)]
                for ref in examples_of(study, given.examples) for goal in given.goals
                for verdict in compared(study, ref, goal, given)]
    above = [worse for ended, worse in verdicts if ended]
    print(f"{len(above)} of {len(verdicts)} layers stopped at their error and show it, {sum(above)} of them above "
          f"{ALLOWED} times their goal")
    return 1 if sum(above) > SHARE * len(above) else 0


if __name__ == "__main__":
    sys.exit(main())
