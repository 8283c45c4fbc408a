"""Weights of all techniques that find one path: against their densities, and as light paths keep them."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from dataset_builder.rendering.transport.lamps import lamps_of
from dataset_builder.rendering.transport.light_paths import EDGES, trace_light
from dataset_builder.rendering.transport.light_sampling import World
from dataset_builder.rendering.transport.weights import edge, light_sample, link, linked, met_by_chance
from tests.rendering.transport.joined_bench import lit, room
from tests.small_scenes import box, light, matte

LANES = 64
PATHS = 4096


@dataclass
class RandomPath:
    """x0 .. xk, y0 in LANES versions: d[i] from x i to x i+1, p[i] the density with which x i goes there, cosines at
    x i towards both neighbours, and what the lamp does."""

    k: int
    d: list[np.ndarray]
    p: list[np.ndarray]
    cos_in: list[np.ndarray]
    cos_out: list[np.ndarray]
    cos_lamp: np.ndarray
    p_n: np.ndarray
    a: np.ndarray
    s: np.ndarray

    @classmethod
    def draw(cls, k, seed):
        rng = np.random.default_rng(seed)
        some = [rng.uniform(0.1, 1, (k + 1, LANES)) for _ in range(4)]
        more = (list(each) for each in some[1:])
        return cls(k, [3 * each for each in some[0]], *more, *rng.uniform(0.1, 1, (2, LANES)),
                   *rng.uniform(0.1, 9, (1, LANES)), rng.uniform(1, 9, (3, LANES)))

    def by_camera(self, end):
        """Density over the areas of x1 .. x end."""
        found = np.ones(LANES)
        for i in range(end):
            found = found * self.p[i] * self.cos_in[i + 1] / self.d[i] ** 2
        return found

    def by_lamp(self, last):
        """Density over the areas of y0, xk .. x last."""
        found = self.a * self.cos_lamp * self.cos_out[self.k] / self.d[self.k] ** 2
        for i in range(self.k, last, -1):
            back = self.p[i] * self.cos_in[i] / self.cos_out[i]
            found = found * back * self.cos_out[i - 1] / self.d[i - 1] ** 2
        return found

    def densities(self):
        """H, N and Lj: see `weights`."""
        lamp = self.cos_lamp / self.d[self.k] ** 2
        links = [self.s[j] * self.by_camera(j) * self.by_lamp(j + 1) for j in range(min(self.k, 3))]
        return np.array([self.by_camera(self.k) * self.p[self.k] * lamp, self.by_camera(self.k) * self.p_n * lamp,
                         *links])

    def weights(self):
        """Of the same techniques, as the product has them."""
        k, a, p_k, p_n = self.k, mi.Float(self.a), mi.Float(self.p[self.k]), mi.Float(self.p_n)
        r = [edge(mi.Float(self.s[j]), mi.Float(self.d[j] ** 2), mi.Float(self.p[j]), mi.Float(self.cos_in[j + 1]))
             for j in range(min(k, 3))]
        h = [link(each, mi.Float(self.cos_out[j + 1]), mi.Float(self.p[j + 1])) for j, each in enumerate(r)]
        before = sum((each for j, each in enumerate(h) if j + 1 < k), mi.Float(0))
        here = r[k - 1] * mi.Float(self.cos_out[k]) if k <= 3 else mi.Float(0)
        every, camera = sum(h, mi.Float(0)), dr.rcp(a) + p_n / (a * p_k)
        return np.array([met_by_chance(p_k, p_n, a, every, mi.Bool(False)),
                         light_sample(p_n, p_k, a, before, here, mi.Bool(False)),
                         *(linked(each, camera, every - each) for each in h)])


@pytest.mark.parametrize("k", [2, 3, 4, 5])
def test_weights_are_densities_over_their_sum(k):
    path = RandomPath.draw(k, seed=k)
    densities = path.densities()
    assert np.allclose(path.weights(), densities / densities.sum(axis=0), rtol=1e-4)
    assert np.allclose(path.weights().sum(axis=0), 1, rtol=1e-5)


def test_a_delta_lobe_leaves_its_edges_to_the_others():
    """At x k, where neither a light sample nor a link may end."""
    found = met_by_chance(mi.Float(3), mi.Float(2), mi.Float(0.5), mi.Float(4), mi.Bool(True))
    others = linked(mi.Float(4), mi.Float(1 / 0.5), mi.Float(0))
    assert (found + others)[0] == pytest.approx(1)
    assert edge(mi.Float(1), mi.Float(1), mi.Float(0), mi.Float(1))[0] == 0
    assert link(mi.Float(1), mi.Float(1), mi.Float(0))[0] == 0
    assert light_sample(mi.Float(0), mi.Float(0), mi.Float(1), mi.Float(1), mi.Float(1), mi.Bool(False))[0] == 0


def traced(opened, depth, seed):
    """PATHS paths of a scene's lamps."""
    world = World(opened.scene, dr.opaque(mi.UInt32, depth), dr.opaque(mi.UInt32, 5), opened.features, None)
    return trace_light(world, lamps_of(opened.scene, PATHS), sets=1, seed=seed)


def columns(values):
    return {"p": values[:, 0:3], "back": values[:, 3:6], "flux": values[:, 6:9], "camera": values[:, 11],
            "again": values[:, 12], "g": values[:, 14], "g2": values[:, 15],
            "facing": values[:, 16:19]}


def dot(a, b):
    return np.einsum("ij,ij->i", a, b)


def test_light_paths_keep_what_camera_paths_would_reckon():
    """In a diffuse room p = cos / pi, so that all that a vertex keeps follows from where the path went."""
    side, height = 0.7, 1.7
    with lit(room(), light("area", (9.0, 8.0, 7.0), position=(0.4, -0.3, height), size=side)) as opened:
        found = traced(opened, 8, 3)
    starts = np.flatnonzero(found.values[:, EDGES] == 1)
    starts = starts[starts + 2 < len(found.values)]
    starts = starts[(found.path[starts + 2] == found.path[starts])]
    assert len(starts) > PATHS / 3
    y1, y2, y3 = (columns(found.values[starts + k].astype(np.float64)) for k in range(3))
    p1, p2 = (dot(y["facing"], y["back"]) / np.pi for y in (y1, y2))
    d1 = (height - y1["p"][:, 2]) / y1["back"][:, 2]
    assert np.allclose(y1["flux"], np.array([9, 8, 7]) * np.pi * side**2, rtol=1e-4)
    assert np.allclose(y1["camera"], np.pi * side**2, rtol=1e-4)
    # Density of a light sample: d^2 / (cos A), over a = 1 / (pi A)
    assert close(y1["again"], np.pi * d1**2 / y1["back"][:, 2])
    for y in (y2, y3):
        assert close(y["camera"], y1["camera"] + y1["again"] / p1)
        assert np.abs(y["again"]).max() == 0
    assert np.abs(y1["g"]).max() == np.abs(y1["g2"]).max() == np.abs(y2["g2"]).max() == 0
    for near, far in ((y1, y2), (y2, y3)):
        way = far["p"] - near["p"]
        # d^2 cos_out / (cos_in p) with p = cos_out / pi
        assert close(far["g"], np.pi * np.linalg.norm(way, axis=1) ** 3 / dot(near["facing"], way))
    assert close(y3["g2"], y2["g"] / p2)


def close(found, expected):
    """Within two hundredths, but for edges so short or slanting that the distance at which rays start shows."""
    return np.mean(np.abs(found / expected - 1) < 0.02) > 0.97 and np.median(np.abs(found / expected - 1)) < 1e-3


@pytest.mark.parametrize("kind", ["point", "sphere"])
def test_flux_of_each_bounce_is_what_the_walls_leave(kind):
    """What arrives at the n-th vertex is what the lamp sends times albedo^(n - 1), in a room that nothing leaves. Paths
    end by chance, so that the number of vertices is binomial: fails in one of 2,000 runs."""
    albedo, depth = 0.7, 8
    lamp = light(kind, (3.0, 2.0, 1.0), position=(0.4, -0.3, 1.2), size=0.003)
    sent = np.array(lamp.radiance) * (4 * np.pi if kind == "point" else 4 * np.pi**2 * lamp.size**2)
    with lit(box(matte((albedo,) * 3), (-2, -2, -1), (2, 2, 2)), lamp) as opened:
        found = traced(opened, depth, 4)
    edges = found.values[:, EDGES]
    assert np.allclose(found.values[edges == 1, 6:9], sent, rtol=1e-3)
    # Paths end by chance, and keep their flux
    assert np.allclose(found.values[:, 6:9], sent, rtol=1e-2)
    expected = PATHS * albedo ** np.arange(depth - 1)
    met = np.array([(edges == k + 1).sum() for k in range(depth - 1)])
    assert met[0] == PATHS and len(edges) == met.sum()
    assert (np.abs(met - expected) < 4 * np.sqrt(expected * (1 - expected / PATHS)) + 1).all()
