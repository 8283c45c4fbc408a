"""Paths that planning traces bring what theory says, and what they say of longer ones is a bound."""

from math import pi

import numpy as np
import pytest

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.label.scene_plan import FogPlan, LightPlan
from dataset_builder.planning.effects import light_left
from dataset_builder.planning.effects.light_left import MAX_DEPTH, LightLeft
from dataset_builder.planning.effects.light_walk import WalkScene, arrivals, from_camera, from_white, joined
from dataset_builder.planning.effects.materials_used import glass_share
from dataset_builder.planning.effects.scattering import about, scatter
from dataset_builder.planning.effects.walk_lamps import WalkLamps
from dataset_builder.planning.effects.walk_surfaces import WalkPart, WalkSurfaces
from dataset_builder.planning.view.emission import facing_irradiance
from dataset_builder.seeding import rng
from tests.planning.scene.houses import box

AIR = np.array([[-9.0, -9, -9], [9, 9, 9]])
CLEAR = FogPlan()
GLASS = Material(name="glass", base_color=(1, 1, 1), roughness=0.0, transmission=1.0, ior=1.5)


def solid(material: Material, *boxes: tuple[tuple[float, ...], tuple[float, ...]]) -> WalkPart:
    """Boxes of one material, from low to high corner."""
    meshes = [box(low, high) for low, high in boxes]
    starts = np.cumsum([0, *(len(positions) for positions, _, _ in meshes)])
    positions = np.concatenate([each for each, _, _ in meshes])
    faces = np.concatenate([faces + start for (_, faces, _), start in zip(meshes, starts, strict=False)])
    mesh = TriangleMesh(positions=positions, faces=faces, uvs=np.zeros((len(faces), 3, 2)),
                        material=np.zeros(len(faces)))
    return WalkPart(asset=Asset(name="box", category="box", mesh=mesh, materials=(material,)), positions=positions)


def scene(*parts: WalkPart, lights: tuple[LightPlan, ...] = (), fog: FogPlan = CLEAR) -> WalkScene:
    return WalkScene(surfaces=WalkSurfaces(parts), lamps=WalkLamps(lights), fog=fog, air=AIR)


def lamp(kind: str, **more: object) -> LightPlan:
    return LightPlan.model_validate({"kind": kind, "position": (0, 0, 2), "direction": (0, 0, -1), "size": 0.4,
                                     "cutoff": 0, "radiance": (3, 3, 3), "temperature": 0, "weight": 1} | more)


def everywhere(count: int, name: str = "ways") -> np.ndarray:
    ball = rng(0, name).normal(size=(count, 3))
    return ball / np.linalg.norm(ball, axis=1, keepdims=True)


@pytest.mark.parametrize("grey", [0.3, 0.8])
def test_a_glowing_box_brings_a_geometric_series(grey: float) -> None:
    """Each of its walls sends 1 and scatters a share of what arrives: after k edges grey^(k - 1) arrives."""
    walls = Material(name="wall", base_color=(grey,) * 3, specular=0.0, emission=(1, 1, 1))
    light = arrivals(scene(solid(walls, ((-1, -1, -1), (1, 1, 1)))), from_camera(np.zeros(3), everywhere(2000)),
                     MAX_DEPTH, rng(1, "walk"))
    assert light.mean(axis=0)[1:6] == pytest.approx(grey ** np.arange(5), rel=0.1)
    found = LightLeft.of([light], grey)
    depths = np.arange(2, 8)
    assert found.share[depths] == pytest.approx(grey ** (depths - 1.0), rel=0.15, abs=1e-3)
    assert (found.bound[depths] >= grey ** (depths - 1.0)).all()


@pytest.mark.parametrize(("kind", "more"), [("area", {}), ("area", {"length": 1.0}), ("disk", {}), ("sphere", {}),
                                            ("point", {}), ("spot", {"cutoff": 40}), ("sun", {})])
def test_lamps_send_what_their_formulas_say(kind: str, more: dict[str, float]) -> None:
    light = lamp(kind, **more)
    floor = np.tile([0.0, 0.0, 0.5], (20_000, 1))
    empty = scene(solid(GLASS, ((5, 5, 5), (6, 6, 6))), lights=(light,))
    sent, crossed, _ = empty.lamps.arriving(floor, np.tile([0.0, 0, 1], (len(floor), 1)), empty.surfaces,
                                           rng(2, kind))
    assert sent.mean(axis=0) == pytest.approx(3 * facing_irradiance(light.kind, 0.4, 1.5, light.length), rel=0.04)
    assert not crossed.any()


def test_light_crosses_every_surface_of_glass_on_its_way() -> None:
    """Five sheets: ten surfaces, of which each leaves 96%."""
    sheets = solid(GLASS, *(((-1, -1, 0.1 * k), (1, 1, 0.1 * k + 0.05)) for k in range(5)))
    passed, crossed = WalkSurfaces([sheets]).between(np.array([[0.1, 0.2, -1.0]]), np.array([[0.1, 0.2, 2.0]]))
    assert crossed[0] == 10 and passed[0] == pytest.approx(0.96**10)
    wall = solid(Material(name="wall", base_color=(1, 1, 1)), ((-1, -1, 1.0), (1, 1, 1.1)))
    passed, _ = WalkSurfaces([sheets, wall]).between(np.array([[0.1, 0.2, -1.0]]), np.array([[0.1, 0.2, 2.0]]))
    assert passed[0] == 0


def test_paths_through_sheets_need_an_edge_for_each_surface() -> None:
    """A sky behind ten sheets: looked at squarely, nothing arrives before 21 edges, and nearly all light by 40."""
    sheets = solid(GLASS, *(((-50, -50, 0.1 * k), (50, 50, 0.1 * k + 0.05)) for k in range(10)))
    behind = solid(Material(name="black", base_color=(0, 0, 0), specular=0.0), ((-60, -60, -3), (60, 60, -2)))
    made = scene(sheets, behind, lights=(lamp("dome", radiance=(1, 1, 1)),))
    light = arrivals(made, from_camera(np.array([0, 0, -1.0]), np.tile([0.0, 0, 1], (3000, 1))), MAX_DEPTH,
                     rng(3, "walk"))
    mean = light.mean(axis=0)
    # Reflected back and forth, 20 surfaces of reflectance R pass (1 - R) / (1 + 19 R): Stokes, 1862
    assert not mean[:21].any() and mean.sum() == pytest.approx(0.96 / (1 + 19 * 0.04), rel=0.06)
    left = LightLeft.of([light], 1.0)
    assert left.share[30] > 0.05 and 40 < left.least(0.01) < 130


def test_glass_and_coats_reflect_what_their_formulas_say() -> None:
    count, down = 40_000, -about(np.tile([0.0, 0, 1], (40_000, 1)), rng(4, "from"))
    block = WalkSurfaces([solid(GLASS, ((-50, -50, -1), (50, 50, 0)))])
    met = block.meet(np.tile([0.0, 0, 1], (count, 1)), down)
    out = scatter(met, down, rng(4, "scatter"))
    assert (out.direction[:, 2] > 0).mean() == pytest.approx(glass_share(1.5, thin=False), abs=0.005)
    # Snell's law
    bent = out.direction[:, 2] < 0
    sines = [np.linalg.norm(each[bent][:, :2], axis=1) for each in (down, out.direction)]
    assert sines[0] == pytest.approx(1.5 * sines[1], abs=1e-6)


def test_white_fog_in_a_white_sky_takes_nothing_and_adds_nothing() -> None:
    made = scene(solid(GLASS, ((50, 50, 50), (51, 51, 51))), lights=(lamp("dome", radiance=(1, 1, 1)),),
                 fog=FogPlan(extinction=0.2, albedo=1.0, anisotropy=0.5))
    light = arrivals(made, from_camera(np.zeros(3), everywhere(500)), MAX_DEPTH, rng(5, "walk"))
    assert light.sum(axis=1) == pytest.approx(1)
    # At least half an optical depth to the way out in every direction
    assert 0.1 < light[:, 1].mean() < np.exp(-0.2 * 9)


def test_depths_in_thick_fog_leave_out_no_more_than_asked() -> None:
    """White fog in a grey room of 3.6 m, where few paths of a hundred edges bring what all bring. The share of light
    that the depth of ten plans leaves out, by 40,000 other paths; each may be above what was asked once in a thousand.
    """
    room = solid(Material(name="wall", base_color=(0.8,) * 3, specular=0.0), ((-1.8, -1.8, -1), (1.8, 1.8, 1.6)))
    made = scene(room, lights=(lamp("area", position=(0, 0.5, 0.5), size=0.3),), fog=FogPlan(extinction=3, albedo=1))

    def left(count: int, number: int) -> LightLeft:
        return LightLeft.of([arrivals(made, from_camera(np.zeros(3), everywhere(count, f"ways {number}")), MAX_DEPTH,
                                      rng(number, "walk"))], 1.0)

    truth = left(40_000, 99).share
    depths = [left(int(light_left.FOG_PATHS / 0.01), number).least(0.01) for number in range(10)]
    assert max(truth[depths]) <= 0.01 and max(depths) < 1.5 * int(np.argmax(truth <= 0.01))


def test_raw_lighting_is_irradiance_over_pi() -> None:
    floor = solid(Material(name="black", base_color=(0, 0, 0), specular=0.0), ((-50, -50, -1), (50, 50, 0)))
    made = scene(floor, lights=(lamp("point", position=(0, 0, 1)),))
    down = np.tile([0.0, 0, -1], (50, 1))
    starts, normals = from_white(made, from_camera(np.array([0, 0, 0.5]), down), rng(6, "white"))
    light = arrivals(made, joined([from_camera(np.array([0, 0, 0.5]), down), starts]), 8, rng(6, "walk"), normals)
    assert not light[:50].any() and light[50:, 2] == pytest.approx(3 / pi, rel=1e-3)


def test_bounds_hold_nearly_always() -> None:
    """Of one path in fifty comes all light of more than three edges: few of 100 samples may miss what it brings."""
    truth, held = 0.02 * 2 / (1 + 0.02 * 2), 0
    for number in range(200):
        light = np.zeros((500, MAX_DEPTH + 1))
        light[:, 3] = 1
        light[:, 5] = 2 * (rng(number, "rare").random(500) < 0.02)
        held += LightLeft.of([light], 1.0).bound[4] >= truth
    assert held >= 198


def test_what_no_path_met_is_bounded_by_hand() -> None:
    """1000 paths whose light has gone 2 edges: later light has a chance of ln(1000) / 1000 at most, and brings half as
    much for each further edge."""
    light = np.zeros((1000, MAX_DEPTH + 1))
    light[:, 2] = 3.0
    left = LightLeft.of([light], 0.5)
    assert not left.share[2:].any()
    assert left.bound[2:5] == pytest.approx(np.log(1000) / 1000 * np.array([0.5, 0.25, 0.125]))
    assert left.least(0.001) == 4


@pytest.mark.parametrize("longest", [5, 127, 128, 255, 256, 400])
def test_short_paths_are_looked_through_as_whole_rows_are(longest: int, monkeypatch: pytest.MonkeyPatch) -> None:
    light = np.zeros((300, MAX_DEPTH + 1))
    light[:, 1:longest + 1] = rng(longest, "light").exponential(size=(300, longest)) * 0.9 ** np.arange(longest)
    short = LightLeft.of([light], 0.8)
    monkeypatch.setattr(light_left, "WIDTHS", ())
    whole = LightLeft.of([light], 0.8)
    assert np.array_equal(short.share, whole.share) and np.array_equal(short.bound, whole.bound)
    assert short.share[longest - 1] > 0 and (longest >= 256) == bool(short.share[longest])
