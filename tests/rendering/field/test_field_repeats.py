"""The same fit has the same bytes: twice, in another process, after an interruption; and what cannot be fitted is told."""

import subprocess
import sys
from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

from dataset_builder.assets.field_file import encode
from dataset_builder.digest import sha256_bytes
from dataset_builder.errors import UserError
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.rendering.field.field_fit import FieldSettings
from tests.rendering.field.ball_views import SETTINGS, Stopped, ball_images, fitted, poses_about, sphere_directions, stop_at

SHORT = replace(SETTINGS, resolution=32, steps=110)
ELSEWHERE = """
from tests.rendering.field.test_field_repeats import digest_of
from dataset_builder.rendering import plugins
from dataset_builder.rendering.backend import activate
activate("llvm", 2)
print(digest_of("{kind}"))
"""


def short_fit(kind: str = "density", **more):
    return fitted(ball_images(sphere_directions(12), size=32), ball_images(sphere_directions(2), size=32),
                  replace(SHORT, kind=kind), **more)


def digest_of(kind: str) -> str:
    return sha256_bytes(encode(short_fit(kind)))


@pytest.mark.parametrize("kind", ["density", "sdf"])
def test_another_process_makes_the_same_bytes(kind: str) -> None:
    there = subprocess.run([sys.executable, "-c", ELSEWHERE.format(kind=kind)], capture_output=True, text=True, check=True)
    threads = dr.thread_count()
    assert digest_of(kind) == there.stdout.strip()
    assert dr.thread_count() == threads


@pytest.mark.parametrize("kind", ["density", "sdf"])
@pytest.mark.parametrize("stop", [36, 86])
def test_an_interrupted_fit_makes_the_same_bytes(kind: str, stop: int, tmp_path) -> None:
    path, steps = tmp_path / "fit.npz", []
    with pytest.raises(Stopped):
        short_fit(kind, checkpoint=path, told=stop_at(stop))
    assert path.exists()
    resumed = short_fit(kind, checkpoint=path, told=lambda progress: steps.append(progress.step))
    assert steps[0] > 36 and steps[-1] == SHORT.steps
    assert encode(resumed) == encode(short_fit(kind)) and not path.exists()


def test_another_seed_makes_other_bytes() -> None:
    one, other = (fitted(ball_images(sphere_directions(8), size=16), ball_images(sphere_directions(1), size=16),
                         FieldSettings(kind="density", resolution=32, steps=12, seed=seed)) for seed in (1, 2))
    assert encode(one) != encode(other)
