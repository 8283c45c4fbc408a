"""Every layer on the device against the CPU: by Z-tests where there is noise, bit by bit but for edges where not."""

import numpy as np
import pytest

from tests.gpu.comparison import deviations, limit
from tests.gpu.conftest import FREE, NOISY, Side

pytestmark = pytest.mark.gpu

SAME = 1e-3
"""Difference that rounding explains: of reflectances, masks and parts of unit vectors absolutely, of depths
relatively. Both sides have the same random numbers."""
EDGES = 0.03
"""Share of the pixels that may differ by more: rays that pass an edge within rounding meet another surface, and a pixel
of 16 samples shows one that does."""
Sides = tuple[Side, Side]


def compared(sides: Sides, request: str, layer: str, tests: int) -> None:
    """Fail with the examples in which a layer is off."""
    cpu, device = (side.layers(request) for side in sides)
    assert cpu.keys() == device.keys() and cpu
    bound, wrong = limit(tests), []
    for key in cpu:
        worst = max(deviations(cpu[key][layer], device[key][layer]), key=lambda found: abs(found.z))
        if abs(worst.z) > bound:
            title = sides[0].figures[request]["titles"][key]
            wrong.append(f"{title}: {worst.where} is {worst.ratio:.4f} times the CPU's, z {worst.z:.1f}")
    assert not wrong, f"layer {layer} of {request} (|z| <= {bound:.2f} expected): " + "; ".join(wrong)


@pytest.mark.parametrize("layer", NOISY)
def test_layers_with_noise_agree(sides: Sides, layer: str) -> None:
    """All effects at once: glass, panes, dispersion, coats, sheen, gaps, what glows, and fog."""
    compared(sides, "effects", layer, tests=len(NOISY) * 4 * 15)


@pytest.mark.parametrize("layer", ["i_t", "s", "spec", "s_prime"])
def test_joined_paths_agree(sides: Sides, layer: str) -> None:
    compared(sides, "joined", layer, tests=4 * 15)


@pytest.mark.parametrize("layer", ["i_t", "s_prime"])
def test_adaptive_goals_agree(sides: Sides, layer: str) -> None:
    """Also where the device chose other numbers of samples."""
    compared(sides, "goal", layer, tests=2 * 15)


@pytest.mark.parametrize("layer", FREE)
def test_layers_without_light_are_the_same(sides: Sides, layer: str) -> None:
    cpu, device = (side.layers("free") for side in sides)
    for key in cpu:
        a, b = cpu[key][layer], device[key][layer]
        scale = np.maximum(np.abs(a), 1) if layer == "depth" else 1.0
        off = float(np.mean(np.any(np.abs(a - b) > SAME * scale, axis=-1)))
        title = sides[0].figures["free"]["titles"][key]
        assert off <= EDGES, f"layer {layer} of {title}: {off:.1%} of the pixels differ (at most {EDGES:.0%} expected)"


@pytest.mark.parametrize("layer", ["i_t", "s_prime"])
def test_denoised_layers_agree(sides: Sides, layer: str) -> None:
    """The denoiser runs on the CPU on both sides: what it made of pictures that differ by noise differs by less."""
    a, b = (next(iter(side.layers("denoised").values())) for side in sides)
    raw, clean = (float(np.sqrt(np.mean((a[name] - b[name]) ** 2))) for name in (f"{layer}_raw", layer))
    assert clean < raw, f"denoised {layer}: pictures differ by {clean:.3g}, noisy ones by {raw:.3g}"
    means = a[layer].mean(), b[layer].mean()
    assert means[1] == pytest.approx(means[0], rel=0.1), f"denoised {layer}: means {means}"


@pytest.mark.parametrize("request_", ["effects", "free", "joined", "goal", "many"])
def test_identities_hold(sides: Sides, request_: str) -> None:
    assert sides[1].figures[request_]["broken"] == []


def test_the_device_rendered(sides: Sides, device: str) -> None:
    assert sides[0].figures["active"] == "llvm" and sides[1].figures["active"] == device
