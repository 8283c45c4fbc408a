"""What denoising keeps, what it mends, and which guides it asks for."""

import sys

import drjit as dr
import numpy as np
import pytest

from dataset_builder.errors import UserError
from dataset_builder.layers import Extent
from dataset_builder.planning.effects.pass_extents import guide_extents
from dataset_builder.rendering import oidn
from dataset_builder.rendering.denoise import Noisy, denoised
from tests.small_scenes import render_plan

try:
    oidn.require()
    MISSING = ""
except UserError as error:
    MISSING = str(error)
needs_oidn = pytest.mark.skipif(bool(MISSING), reason=f"Open Image Denoise: {MISSING}")
Images = dict[str, np.ndarray]


def guides_of(height: int, width: int, inside: np.ndarray | None = None) -> Images:
    """A floor of two colours below a wall, and an object that `inside` marks or that is everywhere."""
    row, column = np.mgrid[0:height, 0:width]
    normal = np.where((row < height // 2)[..., None], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]).astype(np.float32)
    d = np.where((column // 8 % 2 == 0)[..., None], [0.7, 0.5, 0.4], [0.2, 0.3, 0.5]).astype(np.float32)
    mask = (np.ones((height, width)) if inside is None else inside)[..., None].astype(np.float32)
    return {"d": d, "normal": normal, "normal_rough": normal, "mask": mask, "mask_rough": mask.copy()}


def scene(size: int = 48, seed: int = 0) -> tuple[np.ndarray, np.ndarray, Images]:
    """Radiance without noise, the same with relative noise of 0.7, and guides."""
    guides = guides_of(size, size)
    row, column = np.mgrid[0:size, 0:size] / size
    clean = (guides["d"] * (0.3 + np.exp(-4 * ((column - 0.6) ** 2 + (row - 0.7) ** 2)))[..., None]).astype(np.float32)
    noise = np.random.default_rng(seed).gamma(2.0, 0.5, (size, size, 1))
    return clean, (clean * noise).astype(np.float32), guides


def ball(size: int) -> np.ndarray:
    """(size, size) bool: a disc of a third of the size in the middle."""
    row, column = np.mgrid[0:size, 0:size] - size / 2 + 0.5
    return row**2 + column**2 < (size / 3) ** 2


def relief(spp: int, size: int = 64) -> tuple[np.ndarray, np.ndarray, Noisy, Images]:
    """S' of facets that turn at every pixel: without noise, with that of `spp` samples, its direct light, and guides.

    One sample of direct light has a relative deviation of 0.5, one of bounced light, which has no relief, of 3.
    """
    random, guides = np.random.default_rng(spp), guides_of(size, size)
    guides["normal"][:] = [0, 0, 1]
    turned = guides["normal"] + np.random.default_rng(1).normal(0, 0.3, (size, size, 3))
    guides["normal_rough"] = (turned / np.linalg.norm(turned, axis=-1, keepdims=True)).astype(np.float32)
    direct = np.repeat(np.maximum(guides["normal_rough"] @ [0.8, 0, 0.6], 0)[..., None], 3, -1)
    bounced = np.repeat((0.3 + 0.2 * np.mgrid[0:size, 0:size][1] / size)[..., None], 3, -1)

    def noisy(image: np.ndarray, sigma: float) -> np.ndarray:
        shape = spp / sigma**2
        return (image * random.gamma(shape, 1 / shape, (size, size, 1))).astype(np.float32)

    error = (direct * 0.5 / np.sqrt(spp)).astype(np.float32)
    return direct + bounced, noisy(direct, 0.5) + noisy(bounced, 3.0), (noisy(direct, 0.5), error), guides


def one(name: str, image: np.ndarray, guides: Images, extent: Extent, direct: Noisy | None = None) -> np.ndarray:
    return denoised({name: image}, guides, {name: direct} if direct else {}, [name], {name: extent})[name]


def rel_mse(image: np.ndarray, reference: np.ndarray) -> float:
    return float(np.mean((image - reference) ** 2 / (reference**2 + 0.01)))


def test_guides_follow_the_layers_and_their_extents() -> None:
    layers = (("i_s", "object"), ("i_t", "frame"), ("s", "object"), ("s_prime", "object"))
    plan = render_plan().model_copy(update={"layers": layers})

    def asked(*names: str) -> dict[str, Extent]:
        return guide_extents(plan.model_copy(update={"denoise": names}))

    assert asked() == {}
    assert asked("i_s") == {"d": "object", "normal": "object", "mask": "object"}
    assert asked("i_t", "i_s") == asked("i_s", "i_t") == {"d": "frame", "normal": "frame", "mask": "object"}
    assert asked("s") == {"normal": "object", "mask": "object"}
    assert asked("s_prime") == {"normal_rough": "object", "normal": "object", "mask": "object", "mask_rough": "object"}


@needs_oidn
def test_noise_goes() -> None:
    clean, noisy, guides = scene()
    assert rel_mse(one("i_t", noisy, guides, "frame"), clean) < rel_mse(noisy, clean) / 10


@needs_oidn
@pytest.mark.parametrize("extent", ["object", "frame"])
def test_the_mean_stays(extent: Extent) -> None:
    """On the object and on everything else, in each channel."""
    _, noisy, guides = scene()
    inside = ball(48)
    guides["mask"][~inside] = 0
    found = one("i_t", noisy * guides["mask"] if extent == "object" else noisy, guides, extent)
    assert found[inside].mean(axis=0) == pytest.approx(noisy[inside].mean(axis=0), rel=1e-4)
    if extent == "frame":
        assert found[~inside].mean(axis=0) == pytest.approx(noisy[~inside].mean(axis=0), rel=1e-4)


@needs_oidn
def test_noise_goes_from_relief_and_relief_stays() -> None:
    """However many samples there are: no floor of detail that the filter takes for noise."""
    errors = []
    for spp in (16, 64, 256):
        clean, noisy, direct, guides = relief(spp)
        found = rel_mse(one("s_prime", noisy, guides, "frame", direct), clean)
        assert found < rel_mse(one("s_prime", noisy, guides, "frame"), clean) / 4
        errors.append(found)
    assert errors[1] < errors[0] / 3 and errors[2] < errors[1] / 3


@needs_oidn
def test_parts_have_the_mean_and_the_place_of_the_whole() -> None:
    _, noisy, direct, guides = relief(16, 48)
    inside = ball(48)
    for mask in ("mask", "mask_rough"):
        guides[mask][~inside] = 0
    found = one("s_prime", noisy * inside[..., None], guides, "object", direct)
    assert found[inside].mean(axis=0) == pytest.approx(noisy[inside].mean(axis=0), rel=1e-4)
    assert not found[~inside].any() and found.dtype == np.float32 and found.min() >= 0


@needs_oidn
@pytest.mark.parametrize("name", ["i_t", "s", "s_prime"])
def test_outside_of_the_object_nothing_appears(name: str) -> None:
    _, noisy, guides = scene()
    inside = ball(48)
    for mask in ("mask", "mask_rough"):
        guides[mask][~inside] = 0
    found = one(name, noisy * inside[..., None], guides, "object")
    assert not found[~inside].any() and found.dtype == np.float32
    assert found.min() >= 0 and found[inside].min() > 0


@needs_oidn
def test_a_layer_of_the_rough_mesh_lives_where_either_mesh_is() -> None:
    _, noisy, guides = scene()
    guides["mask"][:, 20:], guides["mask_rough"][:, :10] = 0, 0
    inside = (guides["mask"] > 0) | (guides["mask_rough"] > 0)
    found = one("s_prime", noisy * inside, guides, "object")
    assert (found > 0).all()
    assert not one("s", noisy, guides, "object")[:, 20:].any()


@needs_oidn
def test_outlines_are_not_blurred_into_the_black_around() -> None:
    clean, noisy, guides = scene(64)
    inside = ball(64)
    inner = ball(64) & np.roll(inside, 3, 0) & np.roll(inside, -3, 0) & np.roll(inside, 3, 1) & np.roll(inside, -3, 1)
    guides["mask"][~inside] = 0
    outline = inside & ~inner
    found = one("i_t", noisy * inside[..., None], guides, "object")
    assert rel_mse(found[outline], clean[outline]) < rel_mse(noisy[outline], clean[outline]) / 5


@needs_oidn
@pytest.mark.parametrize("size", [(48, 48), (20, 24), (1, 1), (1, 60)])
@pytest.mark.parametrize("value", [1e-4, 0.7, 300.0])
def test_what_has_no_noise_stays(size: tuple[int, int], value: float) -> None:
    """Up to its border, at any brightness."""
    image = np.full((*size, 3), value, dtype=np.float32)
    guides = guides_of(*size)
    guides["normal"][:] = [0, 0, 1]
    assert one("s", image, guides, "frame") == pytest.approx(image, rel=0.01)


@needs_oidn
def test_the_same_image_gives_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Again, and with another number of threads: builds with any number of workers are equal bytes."""
    _, noisy, guides = scene(96)
    runs = []
    for threads in (1, 2, 2, 4):
        monkeypatch.setattr(dr, "thread_count", lambda count=threads: count)
        oidn._device.cache_clear()
        runs.append(one("i_t", noisy, guides, "frame").tobytes())
    oidn._device.cache_clear()
    assert len(set(runs)) == 1


@needs_oidn
def test_other_layers_and_hopeless_ones_stay() -> None:
    _, noisy, guides = scene(24)
    broken, black = noisy.copy(), np.zeros_like(noisy)
    broken[3, 4, 1] = np.nan
    extents = dict.fromkeys(("i_s", "i_s_raw", "i_t", "s"), "frame")
    layers = {"i_s": broken, "i_s_raw": noisy, "i_t": black, "s": noisy}
    found = denoised(layers, guides, {}, ["i_s", "i_t"], extents)
    assert list(found) == list(layers)
    assert found["i_s_raw"] is noisy and found["s"] is noisy
    assert np.isnan(found["i_s"][3, 4, 1]) and not found["i_t"].any()
    nowhere = guides | {"mask": np.zeros_like(guides["mask"])}
    assert not one("i_t", black, nowhere, "object").any()


@needs_oidn
def test_a_firefly_is_not_spread_over_the_whole_object() -> None:
    clean, noisy, guides = scene()
    noisy[10, 10] = 1e5
    found = one("i_t", noisy, guides, "frame")
    far = np.s_[24:]
    assert found[far].mean() < 1.5 * clean[far].mean()


def test_a_missing_denoiser_is_told_with_the_command_that_mends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    with pytest.raises(UserError, match=r"pyoidn is not installed; pip install .*\[denoise\]"):
        oidn.require()
