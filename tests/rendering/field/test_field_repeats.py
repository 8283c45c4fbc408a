"""The same fit has the same bytes: twice, in another process with other threads, and after an interruption."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import drjit as dr
import pytest

from dataset_builder.assets.field_file import FieldFile, encode
from dataset_builder.digest import sha256_bytes
from dataset_builder.rendering.field import field_step, field_training
from tests.rendering.field.ball_views import SETTINGS, Stopped, ball_images, fitted, sphere_directions, stop_at

KINDS = pytest.mark.parametrize("kind", ["density", "sdf"])
ELSEWHERE = """
from dataset_builder.rendering.backend import activate
activate("llvm", 2)
from tests.rendering.field.test_field_repeats import digest_of
print(digest_of("{kind}"))
"""


def short_fit(kind: str, steps: int = 40, seed: int = 5, every: int = 5, **more) -> FieldFile:
    """A poor field of a ball, from few rays."""
    settings = replace(SETTINGS, kind=kind, resolution=32, steps=steps, seed=seed)
    with patch.object(field_step, "RAYS", 512), patch.object(field_training, "EVERY", every):
        return fitted(ball_images(sphere_directions(12), size=32), ball_images(sphere_directions(2), size=32), settings,
                      **more)


def digest_of(kind: str) -> str:
    return sha256_bytes(encode(short_fit(kind)))


@KINDS
def test_another_process_makes_the_same_bytes(kind: str) -> None:
    threads = dr.thread_count()
    there = subprocess.run([sys.executable, "-c", ELSEWHERE.format(kind=kind)], capture_output=True, text=True,
                           check=True)
    assert digest_of(kind) == there.stdout.strip()
    assert dr.thread_count() == threads


@KINDS
@pytest.mark.parametrize("stop", [5, 13, 30])
def test_an_interrupted_fit_makes_the_same_bytes(kind: str, stop: int, tmp_path: Path) -> None:
    """In the first stage, at the end of one, and in the last."""
    path, steps = tmp_path / "fit.npz", []
    with pytest.raises(Stopped):
        short_fit(kind, checkpoint=path, told=stop_at(stop))
    assert path.exists()
    resumed = short_fit(kind, checkpoint=path, told=lambda progress: steps.append(progress.step))
    assert steps[0] > stop and steps[-1] == 40
    # However often the state is kept
    assert encode(resumed) == encode(short_fit(kind, every=50)) and not path.exists()


@pytest.mark.parametrize("damage", ["truncated", "another fit", "no file of this kind"])
def test_a_checkpoint_that_does_not_fit_is_left_alone(damage: str, tmp_path: Path) -> None:
    path, steps = tmp_path / "fit.npz", []
    with pytest.raises(Stopped):
        short_fit("density", checkpoint=path, told=stop_at(5), seed=6 if damage == "another fit" else 5)
    if damage != "another fit":
        path.write_bytes(path.read_bytes()[:-3000] if damage == "truncated" else b"no archive")
    found = short_fit("density", checkpoint=path, told=lambda progress: steps.append(progress.step))
    assert steps[0] == 5 and encode(found) == encode(short_fit("density"))


def test_another_seed_makes_other_bytes() -> None:
    assert encode(short_fit("density", steps=12, seed=1)) != encode(short_fit("density", steps=12, seed=2))
