"""A surface on the bench: made of materials, seen from a direction, asked and sampled."""

import drjit as dr
import mitsuba as mi
import numpy as np
from mitsuba.chi2 import ChiSquareTest, SphericalDomain

from dataset_builder.assets.asset import Material
from dataset_builder.rendering.surface.bsdf import PLUGIN
from dataset_builder.rendering.surface.material_table import MaterialTable, Textures

SAMPLES = 1 << 16


def surface_of(*materials: Material, features=None):
    """A surface of its own, face i of material i, with `features` or everything."""
    surface = mi.load_dict({"type": PLUGIN})
    rows = mi.UInt32(np.arange(len(materials), dtype=np.uint32))
    surface.bind(MaterialTable(textures=Textures.upload(materials), face_material=rows), features)
    return surface


def interaction(cosine, width: int, uv=(0.5, 0.5)):
    """`width` points seen under `cosine`, or under one cosine each; negative ones from behind. Nothing in it is a
    literal, so that all of them share a kernel."""
    cosine = np.broadcast_to(np.asarray(cosine, dtype=np.float32), width)
    si = dr.zeros(mi.SurfaceInteraction3f, width)
    si.wi = mi.Vector3f(mi.Float(np.sqrt(1 - cosine**2)), 0, mi.Float(cosine))
    si.n, si.sh_frame = mi.Normal3f(0, 0, 1), mi.Frame3f(mi.Normal3f(0, 0, 1))
    si.dp_du, si.dp_dv, si.uv = mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0), mi.Point2f(*uv)
    dr.make_opaque(si.wi, si.n, si.sh_frame, si.dp_du, si.dp_dv, si.uv)
    return si


def uniform(seed: int, width: int):
    """A seeded sampler."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, width)
    return sampler


def sampled(surface, si, seed: int = 3, width: int = SAMPLES):
    """(BSDFSample3f, (3, width) weights)."""
    sampler = uniform(seed, width)
    bs, weight = surface.sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d(), mi.Bool(True))
    return bs, np.array(weight)


def mean_and_error(values: np.ndarray):
    """Mean and standard error along the last axis."""
    return values.mean(axis=-1), values.std(axis=-1, ddof=1) / np.sqrt(values.shape[-1])


def directions_follow(surface, cosine: float, test_count: int):
    """A finished chi-square test of `sample` against `pdf`; (passed, messages)."""
    ctx = mi.BSDFContext()

    def sample(numbers):
        width = np.array(numbers).shape[1]
        pair = mi.Point2f(numbers.y, numbers.z)
        bs, _ = surface.sample(ctx, interaction(cosine, width), numbers.x, pair, mi.Bool(True))
        discrete = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
        return bs.wo, mi.Float(np.array(bs.pdf > 0) & ~np.array(discrete))

    def density(directions):
        width = np.array(directions).shape[1]
        return surface.pdf(ctx, interaction(cosine, width), directions, mi.Bool(True))

    test = ChiSquareTest(domain=SphericalDomain(), sample_func=sample, pdf_func=density, sample_dim=3,
                         sample_count=100_000, res=48, ires=8)
    return test.run(0.001, test_count=test_count, quiet=True), test.messages


def hemisphere(side: int, width: int = SAMPLES, seed: int = 11):
    """Uniform directions above (side 1) or below (-1), of density 1 / (2 pi), in strata."""
    count = int(np.sqrt(width))
    jitter = np.random.default_rng(seed).random((2, count, count))
    z, turn = (np.indices((count, count)) + jitter).reshape(2, -1) / count
    flat, phi = np.sqrt(1 - z**2), 2 * np.pi * turn
    return mi.Vector3f(*((axis.astype(np.float32)) for axis in (flat * np.cos(phi), flat * np.sin(phi), side * z)))
