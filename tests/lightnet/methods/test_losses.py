"""Every term is what it says, and finite with finite gradients on all that training can bring."""

from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from torch import nn

from dataset_builder.errors import UserError
from dataset_builder.lightnet.data.batch import Batch, Inputs, Prediction, Truth
from dataset_builder.lightnet.data.ranges import linear_light, tone_map
from dataset_builder.lightnet.measures.colour import lab
from dataset_builder.lightnet.methods.losses import LightObjective
from dataset_builder.lightnet.settings import ObjectiveSpec
from tests.lightnet.vgg_weights import write_weights

SIZE = 24
TERMS = ("dr", "fr", "dssim", "lab", "l1")
ALONE = {name: ObjectiveSpec(**{other: float(other == name) for other in TERMS}) for name in TERMS}
EVERYTHING = ObjectiveSpec(l1=1.0)
Maker = Callable[[ObjectiveSpec], LightObjective]


def noise(seed: int) -> torch.Tensor:
    """(2, 3, SIZE, SIZE) in [0, 1)."""
    return torch.rand(2, 3, SIZE, SIZE, generator=torch.Generator().manual_seed(seed))


def grey(value: float) -> torch.Tensor:
    """(2, 3, SIZE, SIZE) of one value."""
    return torch.full((2, 3, SIZE, SIZE), float(value))


def disc() -> torch.Tensor:
    """(2, 1, SIZE, SIZE) inside a disc."""
    steps = torch.arange(SIZE) - SIZE / 2
    return (steps[:, None] ** 2 + steps ** 2 < 64).float().expand(2, 1, -1, -1)


def one_pixel() -> torch.Tensor:
    """(2, 1, SIZE, SIZE) a single pixel inside, of the first example."""
    inside = torch.zeros(2, 1, SIZE, SIZE)
    inside[0, 0, 5, 7] = 1
    return inside


def batch_of(i_t: torch.Tensor, inside: torch.Tensor) -> Batch:
    """A batch whose truth is given; D and R are noise."""
    inputs = Inputs(i_s=noise(1), s_prime=noise(2), inside=inside, sh=torch.zeros(2, 3, 9))
    return Batch(keys=("a", "b"), exposure=torch.ones(2), inputs=inputs, truth=Truth(i_t=i_t, d=noise(3), r=noise(4)))


def gradients(objective: LightObjective, batch: Batch, i_t: torch.Tensor, d: torch.Tensor, r: torch.Tensor
              ) -> tuple[torch.Tensor, list[torch.Tensor]]:
    """Total and its gradients by I_t, D and R."""
    leaves = [part.clone().requires_grad_() for part in (i_t, d, r)]
    total = objective(batch, Prediction(i_t=leaves[0], d=leaves[1], r=leaves[2])).total
    total.backward()
    return total.detach(), [torch.zeros_like(leaf) if leaf.grad is None else leaf.grad for leaf in leaves]


@pytest.fixture(scope="module")
def objective(tmp_path_factory: pytest.TempPathFactory) -> Maker:
    """Makes objectives with random VGG weights."""
    path = tmp_path_factory.mktemp("vgg") / "random.pth"
    digest = write_weights(path)
    return lambda spec: LightObjective(spec, path, vgg_sha256=digest)


CASES = {
    "identical": (noise(5), noise(5), disc()),
    "black on black": (grey(0), grey(0), disc()),
    "black on colour": (grey(0), noise(5), disc()),
    "colour on black": (noise(5), grey(0), disc()),
    "nearly black": (grey(1e-20), 1e-3 * noise(5), disc()),
    "negative": (-noise(6), noise(5), disc()),
    "very negative": (-1e4 * noise(6), noise(5), disc()),
    "both signs": (1e4 * (noise(6) - 0.5), noise(5), disc()),
    "1e4": (grey(1e4), noise(5), disc()),
    "1e4 on 1e4": (1e4 * noise(6), 1e4 * noise(5), disc()),
    "constant": (grey(0.5), grey(0.5), disc()),
    "other constant": (grey(0.5), grey(0.6), disc()),
    "one pixel": (noise(6), noise(5), one_pixel()),
    "no pixel": (noise(6), noise(5), torch.zeros(2, 1, SIZE, SIZE)),
    "whole frame": (noise(6), noise(5), torch.ones(2, 1, SIZE, SIZE)),
    "NaN outside": (noise(6) + torch.where(disc() > 0, 0, torch.nan), noise(5), disc()),
    "float16": (100 * noise(6).half(), 100 * noise(5).half(), disc().half()),
    "float16 1e4": (grey(1e4).half(), -grey(1e4).half(), disc().half()),
    "bfloat16": (noise(6).bfloat16(), noise(5).bfloat16(), disc().bfloat16()),
}
"""Predicted and true I_t, and inside."""
AT_REST = ("identical", "black on black", "constant")
"""Where prediction and truth are the same."""
TOO_FAR = ("very negative", "both signs", "1e4", "1e4 on 1e4", "float16 1e4")
"""Where tone mapping or SSIM is flat, and a gradient may be as small as it likes."""


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("spec", [*ALONE, "everything"])
def test_finite_with_finite_gradients(spec: str, case: str, objective: Maker) -> None:
    found, wanted, inside = CASES[case]
    d, r = (part.to(found.dtype) for part in (noise(7), noise(8)))
    total, grads = gradients(objective(ALONE.get(spec, EVERYTHING)), batch_of(wanted, inside), found, d, r)
    assert total.dtype == torch.float32 and total.isfinite() and total >= 0
    assert all(grad.isfinite().all() for grad in grads)
    outside = (inside == 0).expand(-1, 3, -1, -1)
    assert not any(grad[outside].any() for grad in grads)
    steepest = max(float(grad.abs().max()) for grad in grads)
    if case == "no pixel":
        assert steepest == 0 and total == 0
    elif spec == "lab" and "black" in case:
        assert steepest == 0
    elif case in AT_REST and spec not in ("dr", "everything"):
        assert steepest < 1e-8 and total < 1e-6
    elif case not in TOO_FAR:
        assert steepest > 1e-6


def test_values_by_hand(objective: Maker) -> None:
    """Display 0.5 against 0.6 on the whole frame; D is 0.1 off and R 0.2."""
    spec = ObjectiveSpec(dr=2.0, fr=0, dssim=3.0, lab=4.0, l1=5.0)
    batch = batch_of(linear_light(grey(0.6)), torch.ones(2, 1, SIZE, SIZE))
    i_t = linear_light(grey(0.5)).requires_grad_()
    loss = objective(spec)(batch, Prediction(i_t=i_t, d=noise(3) + 0.1, r=noise(4) - 0.2))
    dissimilar = (1 - (0.6 + 1e-4) / (0.61 + 1e-4)) / 2
    assert list(loss.terms) == ["dr", "dssim", "lab", "l1"]
    assert float(loss.terms["dr"]) == pytest.approx(0.3, abs=1e-6)
    assert float(loss.terms["dssim"]) == pytest.approx(dissimilar, rel=1e-4)
    assert float(loss.terms["lab"]) < 1e-4 and float(loss.terms["l1"]) == pytest.approx(0.1, abs=1e-6)
    assert loss.total.item() == pytest.approx(0.6 + 3 * dissimilar + 0.5, abs=1e-3) and loss.total.requires_grad
    assert not any(value.requires_grad for value in loss.terms.values())


@pytest.mark.parametrize("layer", ["relu3_1", "relu3_4", "pool3"])
def test_features_are_compared_by_mean_absolute_difference(layer: str, objective: Maker) -> None:
    whole = objective(ALONE["fr"].model_copy(update={"vgg_layer": layer}))
    batch = batch_of(noise(5), disc())
    x, y = (tone_map(image) * disc() for image in (noise(6), noise(5)))
    difference = whole.trunk(x) - whole.trunk(y)
    found = whole(batch, Prediction(i_t=noise(6))).total
    assert float(found) == pytest.approx(float(difference.abs().sum() / difference.numel())) and found > 0.01


def test_every_pixel_inside_counts_alike_and_none_outside() -> None:
    """L1 over two examples with 1 and 3 pixels inside: their pixels' mean, not the mean of the examples' means."""
    inside = one_pixel()
    inside[1, 0, 2, :3] = 1
    wanted = torch.cat([grey(0.2)[:1], grey(0.4)[:1]])
    loss = LightObjective(ALONE["l1"])(batch_of(linear_light(wanted), inside), Prediction(i_t=grey(0)))
    assert float(loss.total) == pytest.approx((0.2 + 3 * 0.4) / 4, abs=1e-6)


@pytest.mark.parametrize("name", [*TERMS, "everything"])
def test_gradients_against_double_precision(name: str, objective: Maker) -> None:
    """float32's gradient against float64's, and float64's along a direction against a finite difference."""
    whole = objective(ALONE.get(name, EVERYTHING))
    found, wanted, parts = 2 * noise(6), 2 * noise(5), (noise(7), noise(8))
    single = gradients(whole, batch_of(wanted, disc()), found, *parts)[1]
    wide, batch = whole.double(), batch_of(wanted.double(), disc())
    points = [part.double() for part in (found, *parts)]
    double = gradients(wide, batch, *points)[1]
    for one, other in zip(single, double, strict=True):
        assert (one - other).abs().max() <= 1e-3 * other.abs().max()
    step = [1e-7 * (noise(20 + index).double() - 0.5) for index in range(3)]
    ahead, behind = (gradients(wide, batch, *(point + sign * move for point, move in zip(points, step, strict=True)))[0]
                     for sign in (1, -1))
    slope = sum(float((grad * move).sum()) for grad, move in zip(double, step, strict=True))
    assert float(ahead - behind) == pytest.approx(2 * slope, rel=1e-3)


def test_parts_that_a_formulation_lacks_are_left_out() -> None:
    whole = LightObjective(ObjectiveSpec(fr=0))
    batch, off = batch_of(noise(5), disc()), noise(3) + 0.25
    assert float(whole(batch, Prediction(i_t=noise(6), d=off)).terms["dr"]) == pytest.approx(0.25, abs=1e-6)
    assert list(whole(batch, Prediction(i_t=noise(6))).terms) == ["dssim", "lab"]
    with pytest.raises(ValueError, match="parts for one of the terms dr"):
        LightObjective(ALONE["dr"])(batch, Prediction(i_t=noise(6)))


def test_what_is_off_is_said(objective: Maker) -> None:
    without = LightObjective(ObjectiveSpec())
    assert len(without.off) == 1 and without.off[0].startswith("fr is off") and "--vgg-weights" in without.off[0]
    assert list(without(batch_of(noise(5), disc()), Prediction(i_t=noise(6))).terms) == ["dssim", "lab"]
    assert not LightObjective(ObjectiveSpec(fr=0)).off and not objective(ObjectiveSpec()).off
    with pytest.raises(UserError, match=r"expected a weight above 0, got none .*vgg19"):
        LightObjective(ALONE["fr"])
    with pytest.raises(UserError, match="expected a file, found none"):
        LightObjective(ObjectiveSpec(), Path("missing.pth"))


def test_nothing_is_trained_or_saved(objective: Maker) -> None:
    whole = objective(EVERYTHING)
    assert not list(whole.parameters()) and not whole.state_dict() and list(whole.buffers())


def test_autocast_does_not_reach_the_losses(objective: Maker) -> None:
    whole, batch = objective(EVERYTHING), batch_of(noise(5), disc())
    prediction = Prediction(i_t=noise(6), d=noise(7), r=noise(8))
    with torch.autocast("cpu", torch.bfloat16):
        assert torch.equal(whole(batch, prediction).total, whole(batch, prediction).total.float())
        inside = whole(batch, prediction).terms
    outside = whole(batch, prediction).terms
    assert all(torch.equal(inside[name], outside[name]) for name in TERMS)


def printed_angle(found: torch.Tensor, wanted: torch.Tensor) -> torch.Tensor:
    """arccos of the cosine, over the whole frame: what one would write first."""
    x, y = lab(tone_map(found)), lab(tone_map(wanted))
    return torch.acos((x * y).sum(1) / (torch.linalg.vector_norm(x, dim=1) * torch.linalg.vector_norm(y, dim=1))).mean()


def test_first_steps_on_a_black_background(objective: Maker) -> None:
    """A network whose last layer is 0 predicts black everywhere at first; arccos gives NaN there."""
    torch.manual_seed(0)
    network = nn.Sequential(nn.Conv2d(6, 8, 3, padding=1), nn.ReLU(), nn.Conv2d(8, 9, 3, padding=1))
    whole, batch = objective(EVERYTHING), batch_of(noise(5) * disc(), disc())
    seen = torch.cat([batch.inputs.i_s, batch.inputs.s_prime], dim=1) * disc()
    for last in (network[2].weight, network[2].bias):
        nn.init.zeros_(last)
    optimiser, totals = torch.optim.Adam(network.parameters(), lr=3e-2), []
    for _ in range(25):
        i_t, d, r = network(seen).split(3, dim=1)
        optimiser.zero_grad()
        total = whole(batch, Prediction(i_t=i_t * disc(), d=d, r=r)).total
        total.backward()
        assert total.isfinite() and all(weight.grad.isfinite().all() for weight in network.parameters())
        optimiser.step()
        totals.append(float(total.detach()))
    assert totals[-1] < 0.7 * totals[0]
    naive = (noise(6) * disc()).requires_grad_()
    printed_angle(naive, batch.truth.i_t).backward()
    assert not naive.grad.isfinite().all()
