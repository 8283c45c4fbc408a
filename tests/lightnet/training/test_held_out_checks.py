"""Checks during training on made examples whose light and noise are known."""

from functools import partial

import numpy as np
import pytest
import torch

from dataset_builder.lightnet.data.batch import Batch, Inputs, Truth
from dataset_builder.lightnet.measures.metrics import METRICS, Metrics, measure
from dataset_builder.lightnet.training.held_out_checks import HeldOutChecks
from tests.lightnet.formula_method import Formula, FormulaMethod
from tests.lightnet.measures.test_truth_noise import INSIDE, noisy, picture

CPU = torch.device("cpu")
EXAMPLES = 8
SHARE = 0.2
OFF = 1.15
"""What a prediction is the light times."""


class Made:
    """Examples whose I_s is the light that I_t shows with noise, which `known` says."""

    def __init__(self, *, known: bool = True):
        self.known = known

    def __len__(self) -> int:
        return EXAMPLES

    def __getitem__(self, index: int) -> Batch:
        light, nothing = picture(index).float(), torch.zeros(1, 3, *INSIDE.shape[-2:])
        truth = noisy(picture(index), SHARE, index)
        inside = INSIDE.float()
        return Batch(keys=(str(index),), exposure=torch.ones(1),
                     inputs=Inputs(i_s=light, s_prime=nothing, inside=inside, sh=torch.zeros(1, 3, 9)),
                     truth=Truth(i_t=truth.i_t.float(), d=nothing, r=nothing,
                                 i_t_se=truth.error.float() if self.known else None))


def checked(checks: HeldOutChecks, formula: Formula) -> dict[str, np.ndarray]:
    """Figures of a check in the order of `METRICS`."""
    found = checks.measure(FormulaMethod(formula).eval(), "float32", CPU)
    return {part: np.array([figures[metric.name] for metric in METRICS]) for part, figures in found.items()}


def made(*, known: bool = True) -> HeldOutChecks:
    return HeldOutChecks(Made(known=known), 0)  # type: ignore[arg-type]


def scaled(inputs: Inputs, *, factor: float) -> torch.Tensor:
    return factor * inputs.i_s


def clean(factor: float) -> np.ndarray:
    """Mean figures of light times a factor, against the light."""
    lights = [picture(index) for index in range(EXAMPLES)]
    every: list[Metrics] = [measure(factor * light, light, INSIDE)[0] for light in lights]
    return np.array([np.mean([getattr(one, metric.name) for one in every]) for metric in METRICS])


def test_the_light_itself_reaches_the_ceiling() -> None:
    found = checked(made(), partial(scaled, factor=1.0))
    # 0.4 dB and 8% at this noise, as in the tests of the ceiling itself
    assert found["metrics"][1] == pytest.approx(found["ceiling"][1], abs=0.4)
    assert found["metrics"][[0, 2, 3]] == pytest.approx(found["ceiling"][[0, 2, 3]], rel=0.08, abs=0.016)


def test_what_is_off_is_told_without_noise() -> None:
    found = checked(made(), partial(scaled, factor=OFF))
    wanted = clean(OFF)
    assert abs(found["corrected"] - wanted)[1] <= 0.1 * abs(found["metrics"] - wanted)[1]
    assert found["corrected"][1] > found["metrics"][1] + 1


def test_the_ceiling_is_the_same_at_every_check_of_the_same_examples() -> None:
    checks = made()
    first, second = (checked(checks, partial(scaled, factor=factor)) for factor in (1.0, OFF))
    assert (first["ceiling"] == second["ceiling"]).all() and (first["corrected"] != second["corrected"]).all()
    fewer = HeldOutChecks(Made(), 2)  # type: ignore[arg-type]
    assert len(fewer) == 2 and (checked(fewer, partial(scaled, factor=1.0))["ceiling"] != first["ceiling"]).any()


def test_where_nobody_knows_the_noise_nothing_is_said() -> None:
    found = made(known=False).measure(FormulaMethod(partial(scaled, factor=OFF)).eval(), "float32", CPU)
    assert found["metrics"]["psnr"] > 10 and found["corrected"] == found["ceiling"] == {}
