"""A closed room with something in it, seen by camera paths and by joined paths, for tests that compare the two."""

from contextlib import contextmanager

import numpy as np
from scipy import stats

from dataset_builder.rendering.passes import RADIANCE_CHANNELS, ViewSensor, radiance_sampler
from dataset_builder.rendering.scene.open_scene import body_of, open_scene
from dataset_builder.rendering.scene.triangle_soup import merge
from tests.small_scenes import box, camera, light, lit_by, matte, render_plan

SIZE, BLOCK = 16, 8
ROUNDING = 1e-5
FRAME = np.arange(SIZE * SIZE)
LAYERS = ("image", "shading", "specular")
OPAQUE = frozenset({"textures", "maps", "specular", "coat", "sheen"})
CLEAR = OPAQUE | {"glass", "thin", "coverage", "emission"}
"""All that joined paths know."""
LAMP = light("area", (9.0, 8.0, 7.0), position=(0.4, -0.3, 1.7), size=0.7)


def room(*things, wall=None):
    """A room of 4 x 4 x 3 m about some soups, with a block on its floor."""
    return merge([*things, box(wall or matte((0.7, 0.6, 0.5)), (-2, -2, -1), (2, 2, 2), 2),
                  box(matte((0.3, 0.5, 0.7)), (0.7, 0.2, -1), (1.3, 0.8, 0.2), 3)])


@contextmanager
def lit(soup, *lights, features=OPAQUE, **more):
    """A traceable scene of a soup under some lights."""
    with open_scene(body_of(soup, features=features), lit_by(*(lights or (LAMP,))), **more) as opened:
        yield opened


def view_of(size=SIZE, batches=4, position=(0.0, -1.9, 0.6)):
    """The camera in the room."""
    return ViewSensor(camera=camera(position, (0, 0, -0.2), fov=75), render=render_plan(size, batches=batches))


def replicas(opened, transport, *, count=16, spp=16, seed=5, depth=6, caustics=False, view=None):
    """(count, P, C) frames that are independent of each other: pixels that are listed `count` times."""
    sample = radiance_sampler(view or view_of(), opened, depth, transport, caustics)
    return sample(np.tile(FRAME, count), spp, 1, seed).mean.reshape(count, len(FRAME), -1)


def layers(frames):
    """Layer -> (count, blocks + 1, 3): means over blocks of pixels, and over the frame."""
    found = {}
    for name in LAYERS:
        values = frames[..., RADIANCE_CHANNELS[name]]
        cut = values.reshape(len(frames), SIZE // BLOCK, BLOCK, SIZE // BLOCK, BLOCK, 3).mean(axis=(2, 4))
        found[name] = np.concatenate([cut.reshape(len(frames), -1, 3), values.mean(axis=1, keepdims=True)], axis=1)
    return found


def differ(ours, theirs, failures):
    """Layers whose expectations differ, by Welch's t-test of blocks and frame; for equal ones any at all in `failures`
    of all runs (Sidak)."""
    ours, theirs, found = layers(ours), layers(theirs), []
    for name in LAYERS:
        _, p = stats.ttest_ind(ours[name], theirs[name], axis=0, equal_var=False)
        # Of matte surfaces the specular part is rounding
        told = np.abs(theirs[name]).max(axis=0) > ROUNDING * theirs["image"].max()
        p = p[np.isfinite(p) & told]
        if p.size and p.min() < 1 - (1 - failures) ** (1 / (p.size * len(LAYERS))):
            found.append(name)
    return found
