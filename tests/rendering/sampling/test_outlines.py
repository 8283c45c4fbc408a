"""What an outline across a pixel adds to its error, and that intervals there hold what they should."""

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from dataset_builder.rendering.passes import RADIANCE_CHANNELS, primary_ray, radiance_sampler
from dataset_builder.rendering.sampling.adaptive import Goal, more_samples, refine
from dataset_builder.rendering.sampling.estimate import Samplers
from dataset_builder.rendering.sampling.moments import Estimate, of_batches
from dataset_builder.rendering.sampling.outlines import STRATA, OutlineSides, outline_variance, share_variance, sides
from dataset_builder.rendering.sampling.owen_sobol import OwenSobol
from dataset_builder.rendering.sampling.pixel_noise import _of_sides, moderated
from dataset_builder.rendering.scene.open_scene import OpenScene
from dataset_builder.rendering.view_sensor import ViewSensor
from tests.rendering.transport.joined_bench import lit, room, view_of
from tests.small_scenes import light, matte

WIDTH = 12
PIXELS = np.arange(WIDTH * WIDTH)
EDGE = PIXELS % WIDTH == 5
SIDE = np.where(PIXELS % WIDTH < 5, 0.0, np.where(EDGE, 0.375, 1.0))
"""A dark half and a bright one, and a column between them that is bright to three eighths."""
BATCHES, PER_BATCH = 4, 4
SIZE, TRUTH_SPP = 24, 1024
LAMPS = {"ball": light("sphere", (9.0, 8.0, 7.0), position=(0.1, 0.9, 0.55), size=0.6),
         "square": light("area", (9.0, 8.0, 7.0), position=(0.1, 0.9, 0.55), direction=(0.3, -1, -0.2), size=1.1)}


def agreeing(values: np.ndarray) -> Estimate:
    """Batches that all found the same."""
    return of_batches(np.repeat(values[:, None, None], BATCHES, axis=1), BATCHES * PER_BATCH)


@pytest.mark.parametrize("size", [4, 12, 16, 64, 256])
def test_the_law_is_that_of_the_points(size: int) -> None:
    """Shares of edges at 16 angles by 1000 batches of Sobol points: a third of the law at least, and not more."""
    points, runs = OwenSobol.of_batches(size, 1000 * size, seed=3).next_2d(), []
    x, y = (np.array(values).reshape(1000, size) for values in (points.x, points.y))
    grid = (np.indices((100, 100)) + 0.5) / 100
    for angle in (np.arange(16) + 0.5) * np.pi / 8:
        across, down = np.cos(angle), np.sin(angle)
        place = np.quantile(across * grid[0] + down * grid[1], 0.4)
        runs.append(np.mean(((across * x + down * y < place).mean(axis=1) - 0.4) ** 2))
    assert 0.33 < np.mean(runs) * size / share_variance(np.array(0.4), np.array(size)) < 1


def test_the_law_by_hand() -> None:
    """Half a pixel by 16 samples, 0.2 / 4; a hundredth is what independent samples have, p (1 - p)."""
    assert share_variance(np.array([0.5, 0.01]), np.array([16.0, 16.0])) == pytest.approx([STRATA / 4, 0.0099])


def test_batches_that_agree_on_an_outline_are_not_believed() -> None:
    """The error is what 16 samples in batches of 4 have across a contrast of 1, and 0 where nothing is near."""
    found = agreeing(SIDE)
    assert (found.error == 0).all()
    known, inner = moderated(found, PIXELS, WIDTH), EDGE & (PIXELS // WIDTH > 1) & (PIXELS // WIDTH < WIDTH - 2)
    expected = np.sqrt(12 / 15 * STRATA / np.sqrt(PER_BATCH) / (BATCHES * PER_BATCH))
    assert known.error[inner] == pytest.approx(expected)
    assert (known.error[np.abs(PIXELS % WIDTH - 5) > 1] == 0).all()
    # What pixels beside it may have of it is less than a sample
    beside = known.error[np.abs(PIXELS % WIDTH - 5) == 1]
    assert ((beside > 0) & (beside < 1 / (BATCHES * PER_BATCH))).all()


def test_noise_is_no_outline() -> None:
    """Contrast of even noise, without any edge, adds less than 5% to the variance."""
    rng = np.random.default_rng(1)
    found = of_batches(rng.gamma(PER_BATCH, 1 / PER_BATCH, (len(PIXELS), BATCHES, 1)), BATCHES * PER_BATCH)
    noise = np.full((len(PIXELS), 1), 1.0)
    assert outline_variance(found, sides(found, noise, PIXELS, WIDTH)).mean() < 0.05


def test_pixels_alone_have_no_contrast() -> None:
    alone = PIXELS[::3][:4] * 2
    found = agreeing(np.arange(4.0))
    assert (outline_variance(found, sides(found, np.zeros((4, 1)), alone, 4 * WIDTH * WIDTH)) == 0).all()


def crossed(view: ViewSensor, opened: OpenScene, pixels: np.ndarray) -> np.ndarray:
    """(P,) of truth: pixels that some of 1024 rays find a lamp in, and some do not."""
    def integrand(_: Samplers, position: mi.Vector2f) -> list[mi.Float]:
        met = opened.scene.ray_intersect(primary_ray(view.sensor(), position))
        return [dr.select(met.is_valid() & (met.emitter(opened.scene) != None), mi.Float(1), 0)]  # noqa: E711

    share = view.estimate(integrand, pixels, 1024, 1, 7).mean[:, 0]
    return (share > 0) & (share < 1)


@pytest.mark.parametrize(("spp", "error"), [(16, 0.0), (64, 0.0), (16, 0.1)])
def test_intervals_hold_lamps_before_a_dark_wall(spp: int, error: float) -> None:
    """I and S where lamps have their outlines, and in the brightest twentieth of the others: 92 to 98%."""
    outlines, bright = [], []
    for lamp in LAMPS.values():
        with lit(room(wall=matte((0.02, 0.02, 0.02))), lamp) as opened:
            view, pixels = view_of(SIZE), np.arange(SIZE * SIZE)
            sample, edge = radiance_sampler(view, opened, 3), crossed(view, opened, pixels)
            truth = sample(pixels, TRUTH_SPP, 8, 999)
            goal = Goal(layer="i_t", channels=RADIANCE_CHANNELS["image"], inside=np.ones(len(pixels), bool),
                        error=error, seconds=0, cap=1024)
            for seed in range(4):
                done = (refine(sample, pixels, SIZE, first=spp, batches=BATCHES, goals=[goal], seed=seed) if error
                        else more_samples(sample, pixels, None, spp=spp, part=0, batches=BATCHES, seed=seed))
                found = done.estimate(pixels, SIZE)
                half = np.hypot(found.interval(), truth.interval())
                for layer in ("image", "shading"):
                    channels = RADIANCE_CHANNELS[layer]
                    held = (np.abs(found.mean - truth.mean) <= half)[:, channels]
                    value = truth.mean[:, channels].mean(axis=1)
                    noisy = (truth.error[:, channels] > 0).any(axis=1) & ~edge
                    outlines.append(held[edge])
                    bright.append(held[noisy & (value > np.quantile(value[noisy], 0.95))])
    assert 0.92 <= np.mean(np.concatenate(outlines)) <= 0.98
    assert 0.92 <= np.mean(np.concatenate(bright)) <= 0.98


BEHIND = {"position": (0.1, 0.9, 0.55)}
HARD = {"ball at a wall": (light("sphere", (9.0, 8.0, 7.0), position=(0.1, 1.79, 0.3), size=0.2), "shading", 64),
        "tube": (light("cylinder", (90.0, 80.0, 70.0), direction=(1, 0, 0.3), size=0.02, length=1.2, **BEHIND), "image",
                 256),
        "batches of one sample": (light("area", (9.0, 8.0, 7.0), position=(0.1, 1.95, 0.3), direction=(0, -1, 0),
                                        size=1.0), "image", 4)}
"""Outlines between noise and none, thinner than a pixel, and of pixels that nothing stratifies: lamp, layer, spp."""


@pytest.mark.parametrize("name", HARD)
def test_intervals_hold_lamps_that_are_hard(name: str) -> None:
    """At least 92% at outlines, by a Z-test over 64 runs: one false alarm in 1,000 where it is just so many."""
    lamp, layer, spp = HARD[name]
    view, pixels, channels = view_of(SIZE), np.arange(SIZE * SIZE), RADIANCE_CHANNELS[layer]
    with lit(room(wall=matte((0.02, 0.02, 0.02))), lamp) as opened:
        sample, edge = radiance_sampler(view, opened, 3), crossed(view, opened, pixels)
        truth, shares = sample(pixels, 4 * TRUTH_SPP, 16, 999), []
        for seed in range(64):
            found = moderated(sample(pixels, spp, BATCHES, seed), pixels, SIZE)
            held = np.abs(found.mean - truth.mean) <= np.hypot(found.interval(), truth.interval())
            shares.append(held[edge, channels].mean())
    assert np.mean(shares) + 3.09 * np.std(shares, ddof=1) / np.sqrt(len(shares)) >= 0.92, np.mean(shares)


def test_sides_keep_their_noise() -> None:
    """A dark half without noise beside a bright one with: right at the border the bright pixels have the noise of
    theirs, as those further in do, to 10% of the variance."""
    random, bright = np.random.default_rng(7), PIXELS % WIDTH >= 6
    found = of_batches(np.where(bright[:, None, None], random.normal(100, 1, (len(PIXELS), 400, 1)), 0), 400)
    found = replace(found, freedom=np.full_like(found.freedom, 3))
    variance = moderated(found, PIXELS, WIDTH).error ** 2 * 400
    outline = outline_variance(found, sides(found, np.ones((len(PIXELS), 1)), PIXELS, WIDTH))
    border = PIXELS % WIDTH == 6
    assert (variance - 12 / 15 * outline)[border & (PIXELS // WIDTH > 1)].mean() == pytest.approx(1, rel=0.1)


def test_each_side_counts_by_its_share_by_hand() -> None:
    """A quarter of the pixel between is bright, where noise is 1, and the rest dark, where it is 0.2: 0.4."""
    means = np.tile([0.0, 25.0, 100.0], 3)[:, None]
    between = OutlineSides(low=np.zeros((9, 1)), high=np.full((9, 1), 100.0), outside=np.zeros((9, 1), bool),
                    told=np.ones((9, 1)))
    noise = np.where(means == 100, 1.0, 0.2)
    noise[1::3] = 0
    outline = np.where(means == 25, 1.0, 0.0)
    assert _of_sides(means, noise, outline, between, np.arange(9), 3)[4, 0] == pytest.approx(0.4)


def test_noise_alone_is_no_outline() -> None:
    """What neighbours differ by is contrast by chance: 1% of the noise, and 8% if that were not taken off."""
    spp, random = 16, np.random.default_rng(5)
    found = of_batches(random.normal(1, np.sqrt(8 / spp), (1024, 8, 1)), spp)
    made = outline_variance(found, sides(found, np.ones((1024, 1)), np.arange(1024), 32))
    assert made.mean() < 0.04
