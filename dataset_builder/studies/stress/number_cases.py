"""Numbers at the ends of their types: half range, denormals, pictures of one pixel, long sums, extreme seeds."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from dataset_builder.planning.scene.arrangement import TARGET_INSTANCE
from dataset_builder.rendering.sampling.estimate import estimate
from dataset_builder.rendering.scene.triangle_soup import merge
from dataset_builder.shards.exr import DTYPES, decode, encode
from dataset_builder.shards.gates import s_prime_energy
from dataset_builder.shards.identities import MASK, check_layers, identity_table
from dataset_builder.spec.dataset import GatesSpec
from dataset_builder.studies.stress.bench import Picture, Shot, at, judged, off_by, on_floor, render, sigmas
from dataset_builder.studies.stress.case import SIGMAS, Case, CaseMeasured, Size, hard_case
from dataset_builder.studies.stress.scenes import ball, bare, camera, floor, light, lit_by, matte, standing

KEY = "00000000"
SUN = lit_by(light("sun", math.pi, direction=(0, 1, -1)))
S_OF_FLOOR = math.sqrt(0.5)
"""E cos / pi under `SUN`, with E = pi."""

DOWN = camera((0, -1, 3), (0, 0, 0), 30)
LOST = "values that differ after storage"


def stored_wrong(values: np.ndarray, layer: str = "i_t") -> int:
    """How many of some values (N,) do not come back from the files of every type exactly as the type rounds them."""
    image = np.resize(values.astype(np.float32), (4, max(len(values), 4), 3))
    wrong = 0
    for dtype in DTYPES:
        back = decode(encode(image, layer=layer, key=KEY, dtype=dtype))
        wrong += int(np.count_nonzero(back.view(np.uint32) != image.astype(dtype).astype(np.float32).view(np.uint32)))
    return wrong


@hard_case(name="number/denormals", bound=0.0, figure=LOST,
           expectation="denormal values of either type come back from an EXR file bit by bit",
           failure="values flushed to 0: a layer's darkest parts lose their steps")
def denormals(size: Size) -> CaseMeasured:
    """The smallest of float32 and of half, both zeros, and what lies between."""
    tiny = np.array([0.0, -0.0, 1e-45, 1e-40, 1.1754942e-38, 6e-8, 1.19e-7, 6.0975552e-5, 6.1035156e-5])
    kept = np.float32(1e-45) > 0
    return CaseMeasured(figure=stored_wrong(np.concatenate([tiny, -tiny]), "normal"),
                        wrong=() if kept else ("expected float32 arithmetic with denormals",))


@hard_case(name="number/half-range", bound=0.0, figure=LOST,
           expectation="the largest half, and values around powers of two, come back from a file as rounded",
           failure="infinite or clipped highlights")
def half_range(size: Size) -> CaseMeasured:
    """Up to 65504, each power's neighbours included."""
    powers = 2.0 ** np.arange(-24, 16)
    about = [powers, powers * (1 - 2**-12), powers * (1 + 2**-11), np.array([65504.0])]
    return CaseMeasured(figure=stored_wrong(np.concatenate(about)))


@hard_case(name="number/all-black-layer", bound=0.0, figure="values that are not 0",
           expectation="where no light arrives, I and S are 0 in picture and file, and the energy gate rejects the "
                       "example",
           failure="NaN from 0 / 0, or a black example in the dataset")
def all_black_layer(size: Size) -> CaseMeasured:
    """A sun from below the floor."""
    picture = render(floor(instance=TARGET_INSTANCE), lit_by(light("sun", direction=(0, 0, 1))),
                     Shot(camera=DOWN, max_depth=2, replicas=1), size)
    black = picture.s.astype(np.float32)
    back = decode(encode(black, layer="s_prime", key=KEY, dtype="float16"))
    mask = picture.mask[..., None].astype(np.float32)
    told = s_prime_energy(back, mask, GatesSpec().s_prime_energy)
    return judged(picture, int(np.count_nonzero(back)) + int(np.count_nonzero(picture.image)),
                  also=() if told else ("expected the gate s_prime_energy to refuse it",))


def checked(picture: Picture) -> list[str]:
    """Identities that the layers of a picture break, as an example would be checked."""
    layers = {"mask": picture.mask[..., None], "d": picture.d, "r": picture.r, "i_t": picture.i, "s": picture.s}
    stored = {name: decode(encode(values.astype(np.float32), layer=name, key=KEY, dtype="float32"))
              for name, values in layers.items()}
    tolerances = {name: tolerance for name, _, tolerance in identity_table("float32")}
    return [problem.identity for problem in check_layers(stored, dict.fromkeys(stored, "frame"), tolerances)]


@hard_case(name="number/mask-of-one-pixel", bound=0.0, figure="pixels of the mask but one",
           expectation="an object that covers part of one pixel has a mask of one pixel, and correct layers",
           failure="an object that is lost, or broken identities: means over a handful of samples")
def mask_of_one_pixel(size: Size) -> CaseMeasured:
    """A chip in the middle of a pixel's footprint."""
    width = 3.2 * math.tan(math.radians(15)) * 2 / size.side
    x, y = 0.5 * width, 0.5 * width
    chip = np.array([[x - 0.3 * width, y - 0.3 * width, 0.1], [x + 0.3 * width, y - 0.3 * width, 0.1],
                     [x, y + 0.3 * width, 0.1]])
    soup = merge([standing(bare(chip, [[0, 1, 2]]), matte(0.8)), floor()])
    seen = camera((0, -1e-3, 3.3), (0, 0, 0), 30)
    picture = render(soup, lit_by(light("sun", math.pi)), Shot(camera=seen, max_depth=2, replicas=4), size)
    return judged(picture, abs(int(np.count_nonzero(picture.mask)) - 1), also=tuple(checked(picture)))


@hard_case(name="number/empty-mask", bound=0.0, figure="pixels of the mask",
           expectation="an object out of the frame has an empty mask, no NaN anywhere, and breaks the identity mask",
           failure="depth or normals of 0 / 0, or an example without its object in the dataset")
def empty_mask(size: Size) -> CaseMeasured:
    """The object is behind the camera, the frame sees the floor and nothing else."""
    soup = merge([ball(matte(), centre=(0, -9, 3)), floor()])
    picture = render(soup, SUN, Shot(camera=DOWN, max_depth=2, replicas=1), size)
    broken = checked(picture)
    return judged(picture, int(np.count_nonzero(picture.mask)),
                  also=() if broken == [MASK] else (f"expected the identity {MASK} to break, got {broken}",))


def frame_of(size: Size, width: int, height: int) -> CaseMeasured:
    """A floor in the sun, in a frame of any size: S is E cos / pi in every pixel, and the file has its shape."""
    narrow = camera((0, -1, 3), (0, 0, 0), 30 if width >= height else 30 * width / height)
    shot = Shot(camera=narrow, size=(width, height), max_depth=2, replicas=1)
    picture = render(floor(instance=TARGET_INSTANCE), SUN, shot, size)
    shape = decode(encode(picture.s.astype(np.float32), layer="s", key=KEY, dtype="float16")).shape
    also = () if shape == (height, width, 3) else (f"expected shape {(height, width, 3)}, got {shape}",)
    wrong = off_by(picture.shading, S_OF_FLOOR) + off_by(picture.mask[..., None], 1.0)
    return judged(picture, wrong, also=also)


FRAME = "largest deviation of S and mask, relative"


one_pixel = Case(
    name="number/image-1x1", bound=1e-5, figure=FRAME, measure=lambda size: frame_of(size, 1, 1),
    expectation="a picture of one pixel shows what it should",
    failure="a crash, or pixels of another size")

one_column = Case(
    name="number/image-1x4096", bound=1e-5, figure=FRAME, measure=lambda size: frame_of(size, 1, 4096),
    expectation="a picture one pixel wide and 4096 high shows what it should",
    failure="rows and columns mixed up, or a field of view that is measured along the wrong side")

one_row = Case(
    name="number/image-4096x1", bound=1e-5, figure=FRAME, measure=lambda size: frame_of(size, 4096, 1),
    expectation="a picture 4096 pixels wide and one high shows what it should",
    failure="rows and columns mixed up")

odd_size = Case(
    name="number/image-37x23", bound=1e-5, figure=FRAME, measure=lambda size: frame_of(size, 37, 23),
    expectation="a picture whose sides are multiples of nothing shows what it should",
    failure="missing pixels at the end of a block")


def seeded(size: Size, seed: int) -> CaseMeasured:
    """S under a ball light against its formula; repeated, the same bits; with the next seed, others."""
    shots = [Shot(camera=DOWN, max_depth=2, seed=each) for each in (seed, seed, (seed + 1) % 2**64)]
    lamp = lit_by(light("sphere", 4.0, position=(0, 1, 1), size=0.5))
    first, again, other = (render(floor(), lamp, shot, size) for shot in shots)
    truth = on_floor(DOWN, at(shots[0], size), lambda p: 1 / np.linalg.norm(p - np.array([0, 1, 1]), axis=-1) ** 3)
    also = [] if np.array_equal(first.shading, again.shading) else ["expected the same bits again"]
    also += [] if not np.array_equal(first.shading, other.shading) else ["expected other bits for another seed"]
    apart = [replica for replica in first.shading[1:] if np.array_equal(replica, first.shading[0])]
    also += [] if not apart else ["expected replicas with random numbers of their own"]
    return judged(first, sigmas(first.shading, truth), also=tuple(also))


seed_zero = Case(
    name="number/seed-0", bound=SIGMAS, figure="worst |z| of pixels and picture", measure=lambda size: seeded(size, 0),
    expectation="seed 0 is a valid seed: right on average, repeatable, unlike its neighbour",
    failure="a generator that is stuck, so that all pixels have the same error")

seed_largest = Case(
    name="number/seed-2^64-1", bound=SIGMAS, figure="worst |z| of pixels and picture",
    measure=lambda size: seeded(size, 2**64 - 1),
    expectation="the largest seed is a valid seed",
    failure="an overflow, or the same picture as for another seed: only half of the bits are used")


DRIFT = 5e-6
"""What float32 sums of a thousand terms are off by, several times over; a million terms in a row lose a hundredth."""

AGAINST_DOUBLE = "deviation from the sum in double, relative"


def long_mean(function: Callable[[Any], Any], size: Size) -> float:
    """Mean over one pixel of a function of the place across it, as passes average their channels, against the double
    sum of the same samples."""
    samples: list[np.ndarray] = []

    def integrand(samplers: Any, position: Any) -> list[Any]:
        values = function(position.x)
        samples.append(np.array(values, dtype=np.float64))
        return [values]
    found = estimate(integrand, np.zeros(1, int), width=1, height=1, spp=size.long, batches=4, seed=1)
    values = np.concatenate(samples)
    if len(values) < size.long:
        return math.inf
    return abs(float(found.mean[0, 0]) / float(values.mean()) - 1)


long_sum = Case(
    name="number/long-sum", bound=DRIFT, figure=AGAINST_DOUBLE,
    measure=lambda size: CaseMeasured(figure=long_mean(lambda x: 0.1 + (x - x), size)),
    expectation="the mean of a million equal samples (65 thousand in a small run) is that of a sum in double",
    failure="drift: a float32 sum grows by rounded steps, all in the same direction")

long_sum_of_unlike = Case(
    name="number/long-sum-of-unlike", bound=DRIFT, figure=AGAINST_DOUBLE,
    measure=lambda size: CaseMeasured(figure=long_mean(lambda x: 2000 * x**9, size)),
    expectation="the same holds for samples between 0 and 2000, most of them small",
    failure="small samples that are lost beside a large sum")


@hard_case(name="number/long-render", bound=DRIFT, figure="deviation of S from E cos / pi, relative",
           expectation="a pixel in the sun keeps its value after a million samples (65 thousand in a small run)",
           failure="drift of the sums in a pass")
def long_render(size: Size) -> CaseMeasured:
    """All samples are equal, so the sum is known."""
    shot = Shot(camera=DOWN, size=(2, 1), max_depth=2, replicas=1, spp=size.long, batches=64)
    picture = render(floor(), SUN, shot, size)
    return judged(picture, off_by(picture.shading, S_OF_FLOOR))
