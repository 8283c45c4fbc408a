"""What `--levels` asks for: noise and fields, what they change in a spec, and what is trained for them."""

from pathlib import Path

import pytest

from dataset_builder.errors import SpecError, UserError
from dataset_builder.lightnet.settings import load_training
from dataset_builder.spec.field import FieldSpec
from dataset_builder.studies.noise.level_trainings import MIXED, jobs
from dataset_builder.studies.noise.noise_study import NoiseStudy, require
from dataset_builder.studies.noise.study_levels import parse_levels
from dataset_builder.studies.trainings import base_of
from tests.small_specs import write_spec

PAPER = "layers={i_s: object, i_t: object, d: object, r: object, s_prime: object, mask: object}"


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_spec(tmp_path_factory.mktemp("levels"))


def made(spec: Path, levels: str, *shared: str, settings: tuple[str, ...] = (), alone: bool = True) -> NoiseStudy:
    return NoiseStudy(spec=spec, overrides=(PAPER,), levels=parse_levels(levels, shared), out=spec.parent / "none",
                      training=base_of(load_training(None, settings)), per_level_steps=1, device="cpu",
                      fields_alone=alone)


def test_levels_are_read() -> None:
    levels = parse_levels("density:views=20,0,4e-3")
    assert [(level.title, level.sigma, level.noise) for level in levels] == [
        ("sigma 0", 0, True), ("sigma 0.004", 0.004, True), ("density, views 20", 0, False)], "noise is first"
    for wrong in ("0,x", "0,", "0,nan", "0,inf", "0,nerf:views=20"):
        with pytest.raises(UserError, match=r"expected numbers, or names .* or fields .* got"):
            parse_levels(wrong)
    with pytest.raises(UserError, match="expected KEY=VALUE of a field, such as views=20, got views"):
        parse_levels("0,sdf:views")


def test_a_spec_has_the_levels_that_were_asked_for(spec: Path) -> None:
    found = made(spec, "0,0.01,density,sdf:views=20:gates.psnr=7", "size=32", "gates.psnr=0").loaded.dataset.rough
    assert found.levels == (0.0, 0.01, FieldSpec(field="density", size=32, gates={"psnr": 0}),
                            FieldSpec(field="sdf", size=32, views=20, gates={"psnr": 7}))
    named = made(spec, "smooth,heavy,density").loaded.dataset.rough
    assert named.levels == ("smooth", "heavy", FieldSpec()) and named.sigma is None
    with pytest.raises(SpecError, match=r"rough\.fields.*views"):
        require(made(spec, "0,0.01,density:views=3"))


def test_training_on_all_levels_leaves_fields_out(spec: Path) -> None:
    """Which sigma to train with is asked of noise; trainings on fields are what could be had with them."""
    found = jobs_of(made(spec, "0,0.01,density"))
    assert found == {MIXED: (0, 1), "level 0": (0,), "level 1": (1,), "level 2": (2,)}
    assert jobs_of(made(spec, "0,0.01,density", alone=False)) == {MIXED: (0, 1), "level 0": (0,), "level 1": (1,)}
    assert jobs_of(made(spec, "0,0.01"))[MIXED] == ()


def jobs_of(study: NoiseStudy) -> dict[str, tuple[int, ...]]:
    return {name: job.levels for name, job in jobs(study).items()}


def test_the_axis_suits_the_levels(spec: Path) -> None:
    assert made(spec, "0,0.01").axis == "roughness_rms" and made(spec, "0,0.01,sdf").axis == "s_relmse"


def test_splits_are_the_datasets_own_where_nobody_named_any(spec: Path) -> None:
    """The spec has train and test; the default to measure on is evaluation."""
    require(made(spec, "0,0.01"))
    with pytest.raises(UserError, match="expected a split evaluation, got train, test"):
        require(made(spec, "0,0.01", settings=("data.held_out=evaluation",)))
