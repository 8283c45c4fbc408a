"""Surfaces that are there in part, that glow, or that lose light between facets: values known by hand."""

from dataclasses import replace

import numpy as np

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.rendering.scene.triangle_soup import Soup, merge
from dataset_builder.studies.stress.bench import Shot, judged, render
from dataset_builder.studies.stress.case import SIGMAS, CaseMeasured, Size, hard_case
from dataset_builder.studies.stress.material_cases import DEEP, ENERGY, MIRROR, SKY, beyond, undiffuse
from dataset_builder.studies.stress.scenes import WIDE, box, camera, floor, matte, quad

STACK, SHARE = 40, 0.05
"""Leaves behind each other, and how much of each is there."""
FRONT = camera((0, -4, 0), fov=26)


def leaf(material: Material, y: float = 0.0) -> Soup:
    """An upright sheet, wider than anything sees."""
    return quad(material, (-WIDE, y, -WIDE), (2 * WIDE, 0, 0), (0, 0, 2 * WIDE), instance=1)


@hard_case(name="material/leaf-stack", bound=SIGMAS, figure="worst |z| of pixels and picture",
           expectation=f"through {STACK} black leaves, each {SHARE:g} there, the sky is {1 - SHARE:g}^{STACK} bright",
           failure="a stack as dark or bright as one leaf: sight ends after a few, or a choice is made only once")
def leaf_stack(size: Size) -> CaseMeasured:
    """The mask holds the rest. Every sample sees the sky or none of it, so that errors are those of a coin at most."""
    stack = merge([leaf(replace(matte(0.0), alpha=SHARE), 0.01 * k) for k in range(STACK)])
    picture = render(stack, SKY, Shot(camera=FRONT), size)
    seen = (1 - SHARE) ** STACK
    coin = np.sqrt(seen * (1 - seen) / size.spp)
    parts = (picture.i.mean(axis=-1), coin / np.sqrt(len(picture.image))), (1 - picture.mask, coin)
    pixels = max(float(np.abs(part - seen).max()) / error for part, error in parts)
    whole = max(abs(float(part.mean()) - seen) / error * np.sqrt(part.size) for part, error in parts)
    return judged(picture, max(pixels, whole))


@hard_case(name="material/white-leaves", bound=0.01, figure=ENERGY,
           expectation="white leaves behind each other, 0.3 of each there, cannot be told from a white sky",
           failure="a veil: light that passes gaps is counted twice, or not at all, on the way to the sky")
def white_leaves(size: Size) -> CaseMeasured:
    """Light goes to and fro between eight of them, through gaps at every crossing."""
    stack = merge([leaf(replace(matte(1.0), alpha=0.3), 0.1 * k) for k in range(8)])
    picture = render(stack, SKY, Shot(camera=FRONT, max_depth=DEEP), size)
    return judged(picture, abs(float(picture.i.mean()) - 1))


@hard_case(name="material/cut-out", bound=1e-6, figure="largest deviation of I",
           expectation="a black leaf is there where alpha is at the cutoff, and nowhere just below it",
           failure="a ghost of what is cut out, or holes where rounding falls below the cutoff")
def cut_out(size: Size) -> CaseMeasured:
    """Alpha 0.5 on the left, 0.499 on the right, in squares as large as texels."""
    alpha = np.array([[0.5, 0.499]], dtype=np.float32)
    texture = Texture(base_color=np.ones((1, 2, 3), np.float32), alpha=alpha, nearest=True)
    picture = render(leaf(replace(matte(0.0), alpha_cutoff=0.5, texture=texture)), SKY, Shot(camera=FRONT), size)
    middle = picture.mask.shape[1] / 2
    columns = np.arange(picture.mask.shape[1]) + 0.5
    there, apart = columns < middle, np.abs(columns - middle) > 1  # A sample on the line itself may fall on either side
    wrong = np.abs(picture.mask - there)[:, apart].max()
    also = () if wrong == 0 else (f"mask: expected 1 on the left and 0 on the right, got it {wrong:g} off",)
    return judged(picture, np.abs(picture.image - ~there[:, None])[:, :, apart].max(), also=also)


@hard_case(name="material/glowing-room", bound=0.01, figure=ENERGY,
           expectation="in a closed room whose walls have albedo 0.5 and send out 0.5, I = S = 1 everywhere",
           failure="a room that is too dark or bright: what a wall sends is lost at some vertex, or counted twice")
def glowing_room(size: Size) -> CaseMeasured:
    """0.5 (1 + 0.5 + 0.25 + ...). The sky outside is there because some light has to be, and does not get in."""
    room = box(replace(matte(0.5), emission=(0.5, 0.5, 0.5)), (-1, -1, -1), (1, 1, 1), 1)
    picture = render(room, SKY, Shot(camera=camera((-0.8, -0.9, 0.8), (-0.9, 0.9, -0.8), 20), max_depth=DEEP), size)
    worst = max(abs(float(part.mean()) - 1) for part in (picture.i, picture.s))
    rest = float(np.abs(picture.image - picture.d * picture.shading - picture.specular).max())
    also = () if rest < 1e-5 else (f"I = D S + rest: expected it for every path, got {rest:g}",)
    return judged(picture, worst, diffuse=False, also=also)


@hard_case(name="material/white-metal", bound=0.02, figure=ENERGY,
           expectation="white metal of any roughness, square on and at a glance, cannot be told from a white sky",
           failure="dark metal: what goes on between facets is lost, up to 69% of the light")
def white_metal(size: Size) -> CaseMeasured:
    """The furnace of a flat surface, four roughnesses by two angles."""
    worst, also = 0.0, []
    for roughness in (0.1, 0.35, 0.7, 1.0):
        plate = floor(replace(MIRROR, roughness=roughness), instance=1)
        for eye in ((0.0, -0.5, 3.0), (0.0, -3.0, 0.3)):
            picture = render(plate, SKY, Shot(camera=camera(eye, (0, 0, 0), fov=4), max_depth=2), size)
            worst = max(worst, abs(float(picture.i.mean()) - 1))
            also += [*undiffuse(picture), *beyond(picture), *judged(picture, 0.0, diffuse=False).wrong]
    return CaseMeasured(figure=worst, wrong=tuple(also))
