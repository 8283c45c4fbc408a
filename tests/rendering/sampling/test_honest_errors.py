"""What the renderer says about its own noise, against converged references of real scenes."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.planning.plan import Planner
from dataset_builder.rendering import plugins
from dataset_builder.rendering.passes import RADIANCE_CHANNELS, radiance_sampler
from dataset_builder.rendering.sampling.adaptive import Goal, more_samples, refine
from dataset_builder.rendering.view_passes import ViewPasses
from dataset_builder.spec.load import load_dataset

SPEC = Path(__file__).parents[3] / "scene_specs" / "3df-lighting-mini.yaml"
EXAMPLES = (0, 20, 50, 70)
SIZE, BATCHES = 32, 4
REFERENCE_SPP = 2048


@pytest.fixture(scope="module")
def scenes() -> list[tuple[Any, slice, np.ndarray, Any]]:
    """(view passes, channels, pixels, reference) of S' in two and I_t in two scenes, on the object."""
    plugins.register()
    loaded = load_dataset(SPEC, [f"image={{width: {SIZE}, height: {SIZE}}}"])
    planner = Planner(loaded)
    found = []
    for index, layer in zip(EXAMPLES, ("shading", "image") * 2, strict=True):
        plan = planner.example(planner.examples[index])
        shared = ViewPasses(plan=plan, mesh_root=loaded.path.parent)
        pixels = shared.covered_by_either(plan)
        reference = sampler(shared)(pixels, REFERENCE_SPP, BATCHES, 999)
        found.append((shared, RADIANCE_CHANNELS[layer], pixels, reference))
        shared.scenes.close()
    return found


def sampler(shared: Any) -> Any:
    """The rough scene under the target light, lit."""
    return radiance_sampler(shared.view, shared.scenes.rough(shared.plan), 12)


@pytest.fixture
def refined(scenes: Any) -> Iterator[Any]:
    """Rounds on one of the scenes, with a goal or without."""
    def run(number: int, error: float, seed: int, first: int = 16) -> Any:
        shared, channels, pixels, _ = scenes[number]
        goal = Goal(layer="l", channels=channels, inside=np.ones(len(pixels), bool), error=error, seconds=0, cap=4096)
        done = (refine(sampler(shared), pixels, SIZE, first=first, batches=BATCHES, goals=[goal], seed=seed) if error
                else more_samples(sampler(shared), pixels, None, spp=first, part=0, batches=BATCHES, seed=seed))
        return done.estimate(pixels, SIZE)

    yield run
    for shared, *_ in scenes:
        shared.scenes.close()


@pytest.mark.parametrize(("error", "first"), [(0.0, 16), (0.0, 64), (0.15, 16)])
def test_intervals_of_95_per_cent_hold_the_truth_in_92_to_98(scenes: Any, refined: Any, error: float,
                                                             first: int) -> None:
    covered = []
    for number, (_, channels, _, reference) in enumerate(scenes):
        for seed in (5, 6):
            found = refined(number, error, seed, first)
            half = np.hypot(found.interval()[:, channels], reference.interval()[:, channels])
            covered.append(np.abs(found.mean - reference.mean)[:, channels] <= half)
    assert min(map(len, covered)) > 50 and sum(map(len, covered)) / 2 >= 200
    assert 0.92 <= np.mean(np.concatenate(covered)) <= 0.98


def test_adaptive_means_of_real_scenes_are_unbiased(scenes: Any, refined: Any) -> None:
    """Mean over the object in 24 runs that stop by themselves, against the reference: |z| < 4 for each of two scenes,
    one false alarm in 8,000."""
    for number in (0, 1):
        _, channels, _, reference = scenes[number]
        truth = reference.mean[:, channels].mean()
        doubt = np.sqrt(np.mean(reference.error[:, channels] ** 2) / reference.mean[:, channels].size)
        means = np.array([refined(number, 0.25, 100 + seed, first=8).mean[:, channels].mean() for seed in range(24)])
        z = (means.mean() - truth) / np.hypot(means.std(ddof=1) / np.sqrt(len(means)), doubt)
        assert abs(z) < 4
