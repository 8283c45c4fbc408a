"""Glass as a renderer meets it: closed bodies, extreme materials, and the first hit of a camera ray."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from dataset_builder.assets.asset import Material
from tests.rendering.surface.surface_bench import SAMPLES, interaction, mean_and_error, sampled, surface_of


@pytest.mark.parametrize("roughness, lost", ((0.0, 1e-3), (0.2, 0.02), (1.0, 0.6)))
def test_a_closed_sphere_of_white_glass_keeps_the_light_of_a_white_furnace(roughness, lost):
    material = Material(name="ball", base_color=(1, 1, 1), roughness=roughness, transmission=1.0)
    scene = mi.load_dict({
        "type": "scene", "light": {"type": "constant"}, "ball": {"type": "sphere", "bsdf": surface_of(material)},
        "sensor": {"type": "orthographic", "film": {"type": "hdrfilm", "width": 32, "height": 32},
                   "to_world": mi.ScalarTransform4f().look_at([0, 0, 3], [0, 0, 0], [0, 1, 0])}})
    image = np.array(mi.render(scene, integrator=mi.load_dict({"type": "path", "max_depth": 200, "rr_depth": 200}),
                               spp=64, seed=1))
    energy, error = mean_and_error(np.asarray(image, dtype=np.float64).reshape(-1, 3).T)
    # Light lost between facets is lost; none is ever made.
    assert np.all(energy < 1 + 5 * error + 1e-4) and np.all(energy > 1 - lost - 5 * error), energy


@pytest.mark.parametrize("roughness", (0.0, 0.01, 0.0316, 0.0317, 1.0))
@pytest.mark.parametrize("thin", (False, True))
def test_extremes_stay_finite(roughness, thin):
    materials = [Material(name=f"{m}", base_color=(0, 0.5, 1), roughness=roughness, transmission=t, metallic=m, ior=ior,
                          thin=thin, abbe=abbe, coat=1.0, coat_roughness=roughness, sheen=(1, 1, 1),
                          sheen_roughness=roughness)
                 for t in (0.5, 1.0) for m in (0.0, 1.0) for ior in (1.0, 1.02, 3.0) for abbe in (0.0, 1.0)]
    cosines = np.repeat([1, 0.5, 1e-3, -1e-3, -0.5, -1], 4000)
    width = len(cosines)
    si = interaction(cosines, width)
    si.prim_index = mi.UInt32(np.arange(width) % len(materials))
    surface = surface_of(*materials)
    bs, weight = sampled(surface, si, width=width)
    value, pdf = surface.eval_pdf(mi.BSDFContext(), si, bs.wo, mi.Bool(True))
    d, r, _ = surface.reflectance(si, mi.Bool(True))
    for found in (bs.wo, bs.pdf, weight, value, pdf, d, r):
        assert np.all(np.isfinite(np.array(found)))
    assert np.all(weight >= 0) and np.all(np.array(pdf) >= 0)
    assert np.all(np.array(d + r) <= 1 + 1e-5) and np.all(np.array(d + r) >= 0)


def test_the_first_hit_tells_discrete_choices_from_the_others():
    half = Material(name="half", base_color=(0.8, 0.8, 0.8), roughness=0.0, transmission=0.5, thin=True)
    surface, si = surface_of(half), interaction(0.6, SAMPLES)
    mean, error = mean_and_error(sampled(surface, si)[1])
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(9, SAMPLES)
    take_cosine = sampler.next_1d() < 0.25
    hit = surface.first_hit(si, [mi.Vector3f(0, 0, 1)], take_cosine, sampler.next_1d(), sampler.next_2d(),
                            mi.Bool(True))
    delta, asked = np.array(hit.delta), ~np.array(take_cosine)
    assert not np.any(delta & ~asked) and np.any(delta & ~np.array(hit.null)) and np.any(np.array(hit.null))
    assert np.all(np.array(hit.pdf)[delta] == 0) and np.all(np.array(hit.value)[:, delta] == 0)
    weight = np.array(dr.select(hit.pdf > 0, hit.value / hit.pdf, 0) + hit.delta_weight)[:, asked]
    again, noise = mean_and_error(weight)
    assert np.all(np.abs(again - mean) < 5 * (error + noise))
