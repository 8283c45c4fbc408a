"""The surface model: its sampling has the density it claims, and D and R are the integrals they are said to be."""

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest
from scipy import stats

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.rendering.surface import reflectance
from dataset_builder.rendering.surface.reflectance import cosines, split_sum_table
from tests.rendering.surface.surface_bench import (
    SAMPLES,
    directions_follow,
    hemisphere,
    interaction,
    mean_and_error,
    sampled,
    surface_of,
)

MATERIALS = {
    "matte": Material(name="matte", base_color=(0.8, 0.5, 0.2), specular=0.0),
    "satin": Material(name="satin", base_color=(0.5, 0.5, 0.5), roughness=0.5),
    "glossy": Material(name="glossy", base_color=(0.1, 0.3, 0.6), roughness=0.25),
    "metal": Material(name="metal", base_color=(0.9, 0.7, 0.3), roughness=0.3, metallic=1.0),
    "mixed": Material(name="mixed", base_color=(0.9, 0.7, 0.3), roughness=0.7, metallic=0.4),
    "coated": Material(name="coated", base_color=(0.7, 0.2, 0.1), roughness=0.6, coat=0.8, coat_roughness=0.3),
    "velvet": Material(name="velvet", base_color=(0.3, 0.1, 0.2), sheen=(0.9, 0.6, 0.3), sheen_roughness=0.4),
    "all opaque": Material(name="all", base_color=(0.9, 0.9, 0.9), roughness=0.4, metallic=0.2, coat=0.5,
                           coat_roughness=0.5, sheen=(0.5, 0.5, 1.0), sheen_roughness=0.2),
}
MIRRORS = {
    "mirror": Material(name="mirror", base_color=(0.95, 0.9, 0.8), roughness=0.0, metallic=1.0),
    "polished": Material(name="polished", base_color=(0.5, 0.4, 0.3), roughness=0.01),
    "varnished": Material(name="varnished", base_color=(0.5, 0.4, 0.3), specular=0.0, coat=1.0),
}
GAUZE = {
    "gauze": Material(name="gauze", base_color=(0.8, 0.5, 0.2), roughness=0.5, alpha=0.3),
    "dusty pane": Material(name="pane", base_color=(0.8, 0.5, 0.2), roughness=0.0, alpha=0.6, transmission=0.7,
                           thin=True),
}
COSINES = (0.999, 0.7, 0.3, 0.08)
WHITE_METAL = Material(name="metal", base_color=(1.0, 1.0, 1.0), metallic=1.0)
ROUGHNESSES = (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0)
STEEP = (1.0, 0.8, 0.5, 0.2, 0.05, 0.02)


@pytest.mark.parametrize("name", [*MATERIALS, *MIRRORS])
@pytest.mark.parametrize("cosine", COSINES)
def test_sampling_weights_average_to_d_plus_r(name, cosine):
    surface, si = surface_of((MATERIALS | MIRRORS)[name]), interaction(cosine, SAMPLES)
    _, weights = sampled(surface, si)
    diffuse, specular, _ = surface.reflectance(si, mi.Bool(True))
    expected, (mean, error) = np.array(diffuse)[:, 0] + np.array(specular)[:, 0], mean_and_error(weights)
    # Five deviations fail once in 30,000 runs of all cases; the tables are good to 2e-3.
    assert np.all(np.abs(mean - expected) < 5 * error + 2e-3), (mean, expected, error)
    assert np.all(expected <= 1 + 1e-6)


@pytest.mark.parametrize("name", [*MATERIALS, "gauze"])
@pytest.mark.parametrize("cosine", (0.4, -0.9))
def test_directions_follow_their_density(name, cosine):
    # One of these correct cases fails once in a thousand runs; the seed is fixed.
    passed, messages = directions_follow(surface_of((MATERIALS | GAUZE)[name]), cosine, 2 * (len(MATERIALS) + 1))
    assert passed, messages


@pytest.mark.parametrize("name", GAUZE)
def test_what_is_not_there_is_passed_with_its_share(name):
    surface, si = surface_of(GAUZE[name]), interaction(0.6, SAMPLES)
    bs, weights = sampled(surface, si)
    past = np.array(mi.has_flag(bs.sampled_type, mi.BSDFFlags.Null))
    through = np.array(surface.eval_null_transmission(si, mi.Bool(True)))[:, 0]
    assert np.allclose(np.array(bs.wo)[:, past], -np.array(si.wi)[:, past], atol=1e-6)
    gone = past & (weights[0] == 1) & (weights[2] == 1)
    # Binomial: five deviations
    expected = 1 - GAUZE[name].alpha
    assert abs(gone.mean() - expected) < 5 * np.sqrt(expected / SAMPLES)
    mean, error = mean_and_error(np.where(past, weights, 0))
    assert np.all(np.abs(mean - through) < 5 * error + 1e-4)


@pytest.mark.parametrize("roughness", ROUGHNESSES)
def test_white_metal_keeps_all_light(roughness):
    """The furnace, over roughness and cosine: R is 1 as reported, and within 2% as sampled: the table of one scattering
    is that good. Single scattering keeps 31% at the worst of these."""
    for cosine in STEEP:
        surface, si = surface_of(replace(WHITE_METAL, roughness=roughness)), interaction(cosine, SAMPLES)
        diffuse, specular, _ = surface.reflectance(si, mi.Bool(True))
        assert np.allclose(np.array(specular), 1, atol=1e-5) and np.array(diffuse).max() == 0
        mean, error = mean_and_error(sampled(surface, si)[1])
        # Four deviations on top of the 2%: once in 15,000 for each if all of the 2% were used up.
        assert np.all(np.abs(mean - 1) < 0.02 + 4 * error), (cosine, mean, error)


@pytest.mark.parametrize("roughness", ROUGHNESSES)
def test_white_plastic_keeps_all_light(roughness):
    plastic = replace(WHITE_METAL, metallic=0.0, roughness=roughness, coat=0.7, coat_roughness=roughness)
    for cosine in STEEP:
        surface, si = surface_of(plastic), interaction(cosine, SAMPLES)
        mean, error = mean_and_error(sampled(surface, si)[1])
        assert np.all(np.abs(mean - 1) < 0.02 + 4 * error), (cosine, mean, error)


def test_the_table_of_one_scattering_is_good_to_two_percent_between_its_nodes(monkeypatch):
    """Against quadrature with 16 times as many points, at angles and roughnesses between the nodes."""
    table = split_sum_table().sum(axis=-1)
    cosine, rough = np.array([3e-4, 2e-3, 6e-3, 0.011, 0.033, 0.09, 0.21, 0.47, 0.77, 0.99]), (0.03, 0.07, 0.13, 0.24,
                                                                                             0.51, 0.83, 0.97)
    monkeypatch.setattr(reflectance, "RADII", 192)
    monkeypatch.setattr(reflectance, "ANGLES", 96)
    for each in rough:
        exact = sum(reflectance._split_sum(cosine, float(reflectance.alpha_of(np.array(each)))))
        x, y = np.sqrt(cosine) * (reflectance.COSINES - 1), each * (reflectance.ROUGHNESSES - 1)
        column, line = x.astype(int), int(y)
        rows = [table[k, column] * (1 - x + column) + table[k, column + 1] * (x - column) for k in (line, line + 1)]
        assert np.allclose(rows[0] * (1 - y + line) + rows[1] * (y - line), exact, rtol=0.02)


def test_lambert_lobe_is_exact_and_two_sided():
    surface, width = surface_of(MATERIALS["matte"]), 16
    above, below = interaction(0.5, width), interaction(-0.5, width)
    wo = mi.Vector3f(0, 0.6, 0.8)
    value = np.array(surface.eval(mi.BSDFContext(), above, wo, mi.Bool(True)))
    assert np.allclose(value, np.array([[0.8], [0.5], [0.2]]) * 0.8 / np.pi, rtol=2e-3)
    assert np.all(np.array(surface.eval(mi.BSDFContext(), below, wo, mi.Bool(True))) == 0)
    behind = np.array(surface.eval(mi.BSDFContext(), below, mi.Vector3f(0, 0.6, -0.8), mi.Bool(True)))
    assert np.array_equal(behind, value)


def test_texels_are_interpolated_and_repeat():
    texels = np.zeros((2, 4, 3), np.float32)
    texels[0, :, 0], texels[1, :, 1] = [0.25, 0.5, 0.75, 1.0], 1.0
    material = Material(name="t", base_color=(1, 1, 1), specular=0.0, texture=Texture(base_color=texels))
    surface = surface_of(material)

    def at(u, v):
        return np.array(surface.eval_diffuse_reflectance(interaction(1.0, 1, (u, v)), mi.Bool(True)))[:, 0]

    # Row 0 lies at v = 1; texel centres are at (i + 0.5) / 4 and 0.25, 0.75.
    assert np.allclose(at(0.375, 0.75), [0.5, 0, 0], atol=1e-3)
    assert np.allclose(at(0.375, 0.25), [0, 1, 0], atol=1e-3)
    assert np.allclose(at(0.5, 0.75), [0.625, 0, 0], atol=1e-3)
    assert np.allclose(at(0.0, 0.75), [0.625, 0, 0], atol=1e-3)
    assert np.allclose(at(-6.625, 7.75), at(0.375, 0.75), atol=1e-3)
    assert np.allclose(at(0.375, 0.5), [0.25, 0.5, 0], atol=1e-3)


def test_normal_map_tilts_the_lambert_lobe():
    tilt = np.zeros((1, 1, 3), np.float32)
    tilt[..., 0], tilt[..., 2] = 0.6, 0.8
    texture = Texture(base_color=np.ones((1, 1, 3), np.float32), normal=tilt)
    surface = surface_of(Material(name="n", base_color=(1, 1, 1), specular=0.0, texture=texture))
    value = np.array(surface.eval(mi.BSDFContext(), interaction(1.0, 1), mi.Vector3f(0, 0, 1), mi.Bool(True)))
    assert np.allclose(value, 0.8 / np.pi, rtol=2e-3)


def test_split_sum_of_a_smooth_mirror_is_schlick():
    mu = cosines()[16:]
    a, b = split_sum_table()[0, 16:].T
    assert np.allclose(b, (1 - mu) ** 5, atol=5e-3)
    assert np.allclose(a + b, 1, atol=2e-2)
    assert stats.pearsonr(b, (1 - mu) ** 5)[0] > 0.999


def test_no_more_light_leaves_than_arrives():
    generator, count, copies = np.random.default_rng(4), 400, 64
    materials = [Material(name=str(i), base_color=tuple(generator.choice([0, 0.5, 1], 3)),
                          roughness=generator.choice([0, 0.05, 0.3, 1]), metallic=generator.choice([0, 0.5, 1]),
                          specular=generator.choice([0, 0.04, 0.16]), coat=generator.choice([0, 0.5, 1]),
                          coat_roughness=generator.choice([0, 0.3, 1]), sheen=tuple(generator.choice([0, 0.5, 1], 3)),
                          sheen_roughness=generator.choice([0, 0.2, 1]), transmission=generator.choice([0, 0.5, 1]),
                          ior=generator.choice([1, 1.5, 3]), thin=bool(generator.integers(2)),
                          alpha=generator.choice([0.3, 1]))
                 for i in range(count)]
    si = interaction(np.tile(np.linspace(1e-3, 1, copies), count), count * copies)
    si.prim_index = mi.UInt32(np.repeat(np.arange(count), copies))
    diffuse, specular, _ = surface_of(*materials).reflectance(si, mi.Bool(True))
    assert np.array(diffuse + specular).max() < 1 + 1e-5
    assert np.array(diffuse).min() >= 0 and np.array(specular).min() >= 0


@pytest.mark.parametrize("material, features", (
    (MATERIALS["matte"], set()),
    (MATERIALS["mixed"], {"specular"}),
    (MATERIALS["coated"], {"specular", "coat"}),
    (MATERIALS["velvet"], {"specular", "sheen"}),
    (Material(name="g", base_color=(0.5, 0.7, 0.9), roughness=0.4, transmission=0.7), {"specular", "glass"}),
    (Material(name="t", base_color=(0.5, 0.7, 0.9), roughness=0.4, transmission=0.7, thin=True), {"specular", "thin"}),
    (Material(name="s", base_color=(0.5, 0.7, 0.9), roughness=0.0, transmission=0.7, thin=True), {"specular", "thin"}),
))
def test_features_that_a_material_does_not_use_change_nothing(material, features):
    si, ctx, active = interaction(0.6, 4096), mi.BSDFContext(), mi.Bool(True)
    full, lean = surface_of(material), surface_of(material, features=frozenset(features))
    for side in (1, -1):
        ours, theirs = (surface.eval_pdf(ctx, si, hemisphere(side, 4096), active) for surface in (full, lean))
        assert np.allclose(np.array(ours[0]), np.array(theirs[0]), rtol=1e-5, atol=1e-7)
        assert np.allclose(np.array(ours[1]), np.array(theirs[1]), rtol=1e-5, atol=1e-7)
    for ours, theirs in zip(full.reflectance(si, active), lean.reflectance(si, active), strict=True):
        assert np.allclose(np.array(ours), np.array(theirs), rtol=1e-5, atol=1e-6)
    assert np.allclose(np.array(full.eval_null_transmission(si, active)),
                       np.array(lean.eval_null_transmission(si, active)), atol=1e-6)


def test_a_kernel_without_what_a_material_needs_is_refused():
    material = Material(name="m", base_color=(1, 1, 1), coat=0.5, sheen=(0, 0.1, 0), transmission=0.5, abbe=30.0)
    surface = surface_of(material)
    with pytest.raises(ValueError, match=r"need \['coat', 'dispersion', 'glass', 'sheen'\]"):
        surface.bind(surface.table, frozenset({"specular", "textures"}))


def test_mitsuba_sees_what_was_bound():
    flags = mi.BSDFFlags
    for features, expected in (({"specular"}, 0), ({"glass"}, flags.DeltaTransmission),
                               ({"thin"}, flags.Null | flags.DeltaReflection)):
        surface = surface_of(MATERIALS["matte"], features=frozenset(features))
        seen = int(np.array(mi.BSDFPtr(surface).flags())[0])
        assert seen & int(expected) == int(expected)
        assert bool(seen & int(flags.Null)) == ("thin" in features)
        assert bool(seen & int(flags.DeltaTransmission)) == bool(features & {"glass", "thin"})


def test_the_coat_lies_flat_on_a_tilted_base():
    tilt = np.zeros((1, 1, 3), np.float32)
    tilt[..., 0], tilt[..., 2] = 0.6, 0.8
    texture = Texture(base_color=np.ones((1, 1, 3), np.float32), normal=tilt)
    material = Material(name="n", base_color=(0, 0, 0), specular=0.0, coat=1.0, coat_roughness=0.1, texture=texture)
    si, ctx = interaction(0.8, 1), mi.BSDFContext()
    straight = np.array(surface_of(material).eval(ctx, si, mi.Vector3f(-0.6, 0, 0.8), mi.Bool(True)))
    tilted = np.array(surface_of(material).eval(ctx, si, mi.Vector3f(0.6, 0, 0.8), mi.Bool(True)))
    assert np.all(straight > 10) and np.all(tilted < 1e-2)


def test_a_perfect_mirror_reflects_what_it_is_coloured():
    si = interaction(0.7, SAMPLES)
    bs, weights = sampled(surface_of(MIRRORS["mirror"]), si)
    schlick = np.array([0.95, 0.9, 0.8]) + (1 - np.array([0.95, 0.9, 0.8])) * 0.3**5
    assert np.allclose(np.median(weights, axis=1), schlick, atol=2e-3)
    # GGX of the smallest alpha sends 1 / (1 + (tan 0.5 / alpha)^2) of its normals, 1.3%, beyond half a degree.
    mirrored = np.array(mi.reflect(si.wi))
    assert np.mean(np.sum(np.array(bs.wo) * mirrored, axis=0) > np.cos(np.radians(1))) > 0.98
