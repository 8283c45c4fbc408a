"""What a pass is asked for: the same values as from a pass that finds everything, and nothing else."""

import mitsuba as mi
import numpy as np
import pytest
from scipy import stats

from dataset_builder.assets.asset import Material
from dataset_builder.rendering import passes
from dataset_builder.rendering.passes import RADIANCE_CHANNELS, WANTED, ViewSensor, channels_of, radiance_channels
from dataset_builder.rendering.scene.open_scene import body_of, open_scene
from dataset_builder.rendering.surface.first_hit import COSINE_SHARE, mixture_pdf
from dataset_builder.rendering.transport.fog import Fog
from dataset_builder.rendering.transport.light_sampling import World
from tests.small_scenes import ball, camera, corner_of_a_room, light, lit_by, matte, render_plan

SURFACES = {
    "matte": matte((0.8, 0.5, 0.2)),
    "metal": Material(name="metal", base_color=(0.9, 0.7, 0.4), roughness=0.2, metallic=1.0),
    "clear glass": Material(name="glass", base_color=(1, 1, 1), roughness=0.0, transmission=1.0, ior=1.5),
    "pane": Material(name="pane", base_color=(0.9, 1, 1), roughness=0.0, transmission=1.0, ior=1.5, thin=True),
}
LAMPS = light("dome", (0.5, 0.5, 0.6), weight=0.5), light("sphere", (20, 18, 15), position=(-0.8, -1.5, 2.5))
SIZE, SEEDS, SPP = 16, 16, 16
FRAME = np.arange(SIZE * SIZE)
ALPHA = 1e-5


def frame_means(opened, name, wanted):
    """(SEEDS, 3) means of a channel over the frame, and the squared standard error of its middling pixel."""
    view, cut = ViewSensor(camera=camera(), render=render_plan(SIZE)), channels_of(wanted)[name]
    # Seeds of their own for each set: the samples shall not be the same
    runs = [passes.radiance(view, opened, FRAME, max_depth=6, spp=SPP, seed=1000 * len(wanted) + seed, wanted=wanted)
            for seed in range(SEEDS)]
    return (np.array([run.mean[:, cut].mean(axis=0) for run in runs]),
            float(np.median(np.mean([run.error[:, cut] ** 2 for run in runs], axis=(0, 2)))))


@pytest.mark.parametrize("foggy", [False, True], ids=["clear", "fog"])
@pytest.mark.parametrize("surface", SURFACES)
def test_one_of_them_alone_is_what_it_is_among_all(surface, foggy):
    fog = Fog(0.2, 0.8, 0.3, [-6, -6, -6], [6, 6, 6]) if foggy else None
    # Welch's test for each of 3 colours, 2 channels and 8 cases: one failure in 2,000 runs
    with open_scene(body_of(corner_of_a_room(ball(SURFACES[surface]))), lit_by(*LAMPS), fog) as opened:
        for name in ("image", "shading"):
            alone, noise = frame_means(opened, name, frozenset({name}))
            among, noise_among = frame_means(opened, name, frozenset(RADIANCE_CHANNELS))
            assert stats.ttest_ind(alone, among, equal_var=False).pvalue.min() > ALPHA
            # Its own lobe is no worse than a mixture, and better where shading has no use for the surface's lobes
            assert noise < (0.8 if name == "shading" and surface != "matte" else 1.2) * noise_among


def test_what_was_not_asked_for_is_not_there():
    assert dict(channels_of(frozenset({"air", "shading"}))) == {"shading": slice(0, 3), "air": slice(3, 6)}
    with open_scene(body_of(ball(matte())), lit_by(LAMPS[0])) as opened:
        view = ViewSensor(camera=camera(), render=render_plan(SIZE))
        found = passes.radiance(view, opened, FRAME, max_depth=3, spp=4, seed=1, wanted=frozenset({"air", "shading"}))
    assert found.mean.shape == (SIZE * SIZE, 6)
    assert found.mean[:, :3].any() and not found.mean[:, 3:].any()
    with pytest.raises(KeyError, match="image"):
        channels_of(frozenset({"shading"}))["image"]


def test_every_layer_with_light_finds_its_channels():
    assert {layer: radiance_channels(layer) for layer in passes.RADIANCE_LAYERS} == {
        "i_s": slice(0, 3), "i_t": slice(0, 3), "s": slice(3, 6), "spec": slice(6, 9), "air": slice(12, 15),
        "s_prime": slice(0, 3), "i_s_clean": slice(0, 3), "i_t_empty": slice(0, 3), "i_pbr": slice(0, 3)}
    assert WANTED["source"] == WANTED["source_clean"] == {"image"} and WANTED["rough"] == {"shading"}


@pytest.mark.parametrize(("wanted", "share"), [({"image"}, 0), ({"image", "specular", "air"}, 0), ({"shading"}, 1),
                                               ({"image", "shading"}, COSINE_SHARE)])
def test_first_direction_is_drawn_for_what_is_wanted(wanted, share):
    world = World(None, mi.UInt32(2), mi.UInt32(2), frozenset(), None, wanted=frozenset(wanted))
    assert world.cosine_share == share
    assert np.allclose(mixture_pdf(mi.Float(2), mi.Float(6), share), 2 + 4 * share)
