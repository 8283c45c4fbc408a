"""Glass obeys Snell, Fresnel, reciprocity and the conservation of energy, and its sampling its density."""

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from dataset_builder.assets.asset import Material
from dataset_builder.rendering.surface.first_hit import transparency
from dataset_builder.rendering.surface.nesting import time_of
from tests.rendering.surface.surface_bench import (
    SAMPLES,
    directions_follow,
    hemisphere,
    interaction,
    mean_and_error,
    sampled,
    surface_of,
)

CLEAR = Material(name="clear", base_color=(1, 1, 1), roughness=0.0, transmission=1.0)
FROSTED = Material(name="frosted", base_color=(0.9, 0.6, 0.25), roughness=0.5, transmission=1.0)
PRISM = Material(name="prism", base_color=(0.9, 0.6, 0.25), roughness=0.5, transmission=1.0, ior=1.6, abbe=20.0)
SHOWER = Material(name="shower", base_color=(0.9, 0.6, 0.25), roughness=0.6, transmission=1.0, thin=True)
MIXED = Material(name="mixed", base_color=(0.9, 0.6, 0.25), roughness=0.5, transmission=0.6, metallic=0.3, coat=0.7,
                 coat_roughness=0.3, sheen=(0.5, 0.2, 0.1))
PANE = Material(name="pane", base_color=(0.9, 0.6, 0.25), roughness=0.0, transmission=1.0, thin=True)
ROUGH = {"frosted": FROSTED, "prism": PRISM, "shower": SHOWER, "mixed": MIXED}


def fresnel(cos_i, index):
    """Unpolarised reflectance of a face, from Snell's law and Fresnel's two amplitudes; 1 under total reflection."""
    cos_i = np.asarray(cos_i, dtype=np.float64)
    sine2 = (1 - cos_i**2) / index**2
    cos_t = np.sqrt(np.maximum(1 - sine2, 0))
    s = (cos_i - index * cos_t) / (cos_i + index * cos_t)
    p = (index * cos_i - cos_t) / (index * cos_i + cos_t)
    return np.where(sine2 >= 1, 1, (s**2 + p**2) / 2)


def channel_indices(ior, abbe):
    """Cauchy's n = A + B / l^2 through n_d with the main dispersion that the Abbe number gives, at R, G and B."""
    inverse = {name: length**-2.0 for name, length in
               {"d": 587.6, "F": 486.1, "C": 656.3, "R": 611.0, "G": 549.0, "B": 464.0}.items()}
    b = (ior - 1) / abbe / (inverse["F"] - inverse["C"])
    return np.array([ior - b * inverse["d"] + b * inverse[name] for name in "RGB"])


@pytest.mark.parametrize("name", ROUGH)
@pytest.mark.parametrize("cosine", (0.8, -0.4))
def test_directions_follow_their_density(name, cosine):
    # One of these correct cases fails once in a thousand runs; the seed is fixed.
    passed, messages = directions_follow(surface_of(ROUGH[name]), cosine, 2 * len(ROUGH))
    assert passed, messages


@pytest.mark.parametrize("name", ROUGH)
@pytest.mark.parametrize("cosine", (0.8, 0.2, -0.4))
def test_weight_is_value_over_density(name, cosine):
    surface, si = surface_of(ROUGH[name]), interaction(cosine, SAMPLES)
    bs, weight = sampled(surface, si)
    value, density = surface.eval_pdf(mi.BSDFContext(), si, bs.wo, mi.Bool(True))
    met = np.array(bs.pdf) > 0
    assert met.mean() > 0.6 and np.all(weight[:, ~met] == 0)
    assert np.allclose(np.array(bs.pdf)[met], np.array(density)[met], rtol=1e-3)
    assert np.allclose(weight[:, met], np.array(value)[:, met] / np.array(density)[met], rtol=2e-3, atol=1e-5)


@pytest.mark.parametrize("cosine", (0.8, 0.1, -0.9, -0.4))
@pytest.mark.parametrize("side", (1, -1))
def test_rough_glass_is_that_of_mitsuba(cosine, side):
    material = Material(name="white", base_color=(1, 1, 1), roughness=0.5, transmission=1.0)
    theirs = mi.load_dict({"type": "roughdielectric", "distribution": "ggx", "alpha": 0.25, "int_ior": 1.5,
                           "ext_ior": 1.0})
    si, wo, ctx = interaction(cosine, 4096), hemisphere(side, 4096), mi.BSDFContext()
    ours, density = surface_of(material).eval_pdf(ctx, si, wo, mi.Bool(True))
    assert np.allclose(np.array(ours), np.array(theirs.eval(ctx, si, wo)), rtol=1e-3, atol=1e-5)
    assert np.allclose(np.array(density), np.array(theirs.pdf(ctx, si, wo)), rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("name", ROUGH)
@pytest.mark.parametrize("cosine", (0.4, -0.9, -0.3))
def test_weights_average_to_the_integral_of_the_values(name, cosine):
    surface, si = surface_of(ROUGH[name]), interaction(cosine, SAMPLES)
    mean, error = mean_and_error(sampled(surface, si)[1])
    integral, noise = 0, 0
    for side in (1, -1):
        value = surface.eval(mi.BSDFContext(), si, hemisphere(side), mi.Bool(True))
        part, part_error = mean_and_error(2 * np.pi * np.array(value))
        integral, noise = integral + part, noise + part_error
    assert np.all(np.abs(mean - integral) < 5 * (error + noise) + 1e-4), (mean, integral)


@pytest.mark.parametrize("roughness", (0.0, 0.4))
@pytest.mark.parametrize("cosine", (0.7, -0.9))
@pytest.mark.parametrize("left", ((0, 0, 1), (1, 0.2, 0.6)))
def test_what_channels_are_left_moves_no_mean(roughness, cosine, left):
    """A path that is left with some channels brings on average what any path brings in them."""
    strong = surface_of(Material(name="strong", base_color=(1, 1, 1), roughness=roughness, transmission=1.0, ior=1.6,
                                 abbe=3.0))
    found = []
    for seed, code in enumerate((mi.Float(0), time_of(mi.Color3f(*left), mi.UInt32(0)))):
        si = interaction(cosine, SAMPLES)
        si.time = dr.opaque(mi.Float, code[0])
        found.append(mean_and_error(sampled(strong, si, seed=5 + seed)[1]))
    (mean, error), (alone, noise) = found
    kept = np.array(left) > 0
    assert np.all((np.abs(mean - alone) < 4.5 * np.hypot(error, noise) + 1e-6)[kept])


def test_a_path_with_one_channel_left_has_that_channels_density():
    surface, channel = surface_of(PRISM), 2
    si = interaction(0.7, SAMPLES)
    si.time = dr.opaque(mi.Float, time_of(mi.Color3f(0, 0, 1), mi.UInt32(0))[0])
    bs, weight = sampled(surface, si)
    single = surface_of(replace(PRISM, ior=float(channel_indices(1.6, 20.0)[channel]), abbe=0.0))
    value, density = single.eval_pdf(mi.BSDFContext(), si, bs.wo, mi.Bool(True))
    met = np.array(bs.pdf) > 0
    assert met.mean() > 0.6 and np.allclose(np.array(bs.pdf)[met], np.array(density)[met], rtol=2e-3)
    assert np.allclose(weight[channel, met], np.array(value)[channel, met] / np.array(density)[met], rtol=5e-3)


@pytest.mark.parametrize("name", ROUGH)
@pytest.mark.parametrize("cosine", (0.95, 0.5, 0.15))
def test_d_and_r_are_the_light_sent_back(name, cosine):
    surface, si = surface_of(ROUGH[name]), interaction(cosine, SAMPLES)
    value = surface.eval(mi.BSDFContext(), si, hemisphere(1), mi.Bool(True))
    integral, error = mean_and_error(2 * np.pi * np.array(value))
    diffuse, specular, _ = surface.reflectance(si, mi.Bool(True))
    assert np.all(np.abs(np.array(diffuse + specular)[:, 0] - integral) < 5 * error + 4e-3)


@pytest.mark.parametrize("cosine", (1.0, 0.5, 0.1, -0.9, -0.5))
def test_smooth_glass_reflects_and_refracts_by_fresnel_and_snell(cosine):
    surface, si = surface_of(CLEAR), interaction(cosine, SAMPLES)
    bs, weight = sampled(surface, si)
    index = 1.5 if cosine > 0 else 1 / 1.5
    expected = fresnel(abs(cosine), index)
    wo, kind = np.array(bs.wo), np.array(bs.sampled_type)
    reflected = kind == int(mi.BSDFFlags.DeltaReflection)
    assert np.array_equal(~reflected, kind == int(mi.BSDFFlags.DeltaTransmission))
    assert abs(reflected.mean() - expected) < 5 * np.sqrt(expected * (1 - expected) / SAMPLES) + 1e-6
    # Reflection keeps radiance; refraction scales it by the inverse square of the index, which leaving undoes.
    assert np.allclose(weight[:, reflected], 1, rtol=1e-4)
    assert np.allclose(weight[:, ~reflected], index**-2, rtol=1e-4)
    sine = np.sqrt(1 - cosine**2)
    assert np.allclose(wo[:, reflected], [[-sine], [0], [cosine]], atol=1e-5)
    if expected < 1:
        down = -np.sign(cosine) * np.sqrt(1 - (sine / index) ** 2)
        assert np.allclose(wo[:, ~reflected], [[-sine / index], [0], [down]], atol=1e-5)
        assert np.allclose(np.array(bs.eta)[~reflected], index, rtol=1e-5)
    _, r, _ = surface.reflectance(si, mi.Bool(True))
    assert np.allclose(np.array(r)[:, 0], expected, atol=1e-5)
    value, density = surface.eval_pdf(mi.BSDFContext(), si, bs.wo, mi.Bool(True))
    assert np.all(np.array(value) == 0) and np.all(np.array(density) == 0)


def test_rough_glass_is_reciprocal_up_to_the_squared_index():
    surface, count, generator = surface_of(FROSTED), 4096, np.random.default_rng(5)
    above, below = generator.uniform(0.1, 1, count), generator.uniform(0.1, 1, count)
    turn = generator.uniform(0, 2 * np.pi, count)

    def seen(cosine, other, turn):
        sine = np.sqrt(1 - other**2)
        wo = mi.Vector3f(*(a.astype(np.float32) for a in (sine * np.cos(turn), sine * np.sin(turn), other)))
        return np.array(surface.eval(mi.BSDFContext(), interaction(cosine, count), wo, mi.Bool(True))) / np.abs(other)

    inward, outward = seen(above, -below, turn), seen(-below, above, -turn)
    assert (inward > 1e-3).mean() > 0.15
    assert np.allclose(inward, outward / 1.5**2, rtol=2e-3, atol=1e-5)
    back, forth = seen(above, below, turn), seen(below, above, -turn)
    assert np.allclose(back, forth, rtol=2e-3, atol=1e-5)


@pytest.mark.parametrize("cosine", (1.0, 0.6, -0.2))
def test_smooth_pane_reflects_from_both_faces_and_passes_the_rest_straight_on(cosine):
    surface, si = surface_of(PANE), interaction(cosine, SAMPLES)
    face = fresnel(abs(cosine), 1.5)
    passed = np.array(transparency(mi.BSDFPtr(surface), si, mi.Bool(True)))
    tint = np.array([0.9, 0.6, 0.25])
    assert np.allclose(passed[:, 0], tint * (1 - face) / (1 + face), atol=1e-5)
    _, r, _ = surface.reflectance(si, mi.Bool(True))
    assert np.allclose(np.array(r)[:, 0], 2 * face / (1 + face), atol=1e-5)
    bs, weight = sampled(surface, si)
    straight = np.array(bs.sampled_type) == int(mi.BSDFFlags.Null)
    share = (1 - face) / (1 + face)
    assert abs(straight.mean() - share) < 5 * np.sqrt(share * (1 - share) / SAMPLES)
    assert np.array_equal(np.array(bs.wo)[:, straight], -np.array(si.wi)[:, straight])
    assert np.allclose(weight[:, straight], tint[:, None], rtol=1e-4)
    assert np.allclose(weight[:, ~straight], 1, rtol=1e-4) and np.all(np.array(bs.eta) == 1)


@pytest.mark.parametrize("material", (CLEAR, FROSTED, SHOWER))
def test_only_smooth_panes_are_transparent(material):
    passed = surface_of(material).eval_null_transmission(interaction(0.7, 4), mi.Bool(True))
    assert np.all(np.array(passed) == 0)


@pytest.mark.parametrize("roughness", (0.0, 0.5, 1.0))
def test_glass_of_index_one_is_not_there(roughness):
    air = Material(name="air", base_color=(1, 1, 1), roughness=roughness, transmission=1.0, ior=1.0, abbe=30.0)
    si = interaction(np.linspace(-1, 1, 1000), 1000)
    bs, weight = sampled(surface_of(air), si, width=1000)
    assert np.allclose(np.array(bs.wo), -np.array(si.wi), atol=2e-4)
    assert np.allclose(weight, 1, atol=1e-5)


@pytest.mark.parametrize("cosine", (0.8, -0.95))
def test_dispersion_follows_cauchy_in_each_channel(cosine):
    prism = Material(name="prism", base_color=(1, 1, 1), roughness=0.0, transmission=1.0, ior=1.6, abbe=20.0)
    bs, weight = sampled(surface_of(prism), interaction(cosine, SAMPLES))
    indices = channel_indices(1.6, 20.0) if cosine > 0 else 1 / channel_indices(1.6, 20.0)
    refracted = np.array(bs.wo)[2] * cosine < 0
    sines = -np.array(bs.wo)[0]
    for channel, index in enumerate(indices):
        own = refracted & (weight[channel] > 0)
        assert 0.2 < own.mean() < 0.4
        assert np.allclose(sines[own], np.sqrt(1 - cosine**2) / index, atol=1e-4)
        assert np.all(np.delete(weight, channel, axis=0)[:, own] == 0)
    mean, error = mean_and_error(weight)
    reflected = fresnel(abs(cosine), indices)
    assert np.all(np.abs(mean - reflected - (1 - reflected) / indices**2) < 5 * error)


def test_without_an_abbe_number_nothing_disperses():
    si = interaction(0.6, 4096)
    with_it, without = (sampled(surface_of(CLEAR, features=features), si, width=4096)[1]
                        for features in (None, frozenset({"glass"})))
    assert np.allclose(with_it.min(axis=0), with_it.max(axis=0), rtol=1e-5)
    for weight in (with_it, without):
        assert np.allclose(np.unique(np.round(weight, 3)), [0.444, 1], atol=1e-3)
