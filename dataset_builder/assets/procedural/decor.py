"""Floor lamps, vases and plants."""

import numpy as np
from scipy.interpolate import PchipInterpolator

from dataset_builder.assets.procedural import materials
from dataset_builder.assets.procedural.boxes import lattice_box, solid, split_quads
from dataset_builder.assets.procedural.fittings import foot_disc, round_leg
from dataset_builder.assets.procedural.parts import GAP, Made, Part, bent, moved, rod, turned_about_z
from dataset_builder.assets.procedural.round_solids import COARSE, disc, hoop, turned
from dataset_builder.geometry.mesh import TriangleMesh


def floor_lamp(params: dict[str, float], finish_rng: np.random.Generator, _: np.random.Generator) -> Made:
    """Lamp with a cloth shade on a disc or a tripod. It gives no light: emitters belong to the illumination."""
    stand = materials.one_of(finish_rng, materials.metal, materials.metal, materials.wood)
    finishes = {"stand": stand, "shade": materials.linen(finish_rng), "bulb": materials.ceramic(finish_rng, "white")}
    low = params["height"] - params["shade_height"]
    socket = low + 0.25 * params["shade_height"]
    base = _tripod(params, socket) if params["base"] else _disc_base(params, socket)
    return [*base, *_shade(params, low, socket), *_bulb(params, socket)], finishes


def _disc_base(params: dict[str, float], socket: float) -> list[Part]:
    foot, pole = max(0.30 * params["shade_width"] + 0.03, 0.13), params["pole"] / 2
    rise = np.array([(foot - 0.003, 0), (foot, 0.003), (foot, 0.012), (foot - 0.004, 0.016), (0.35 * foot, 0.020),
                     (2.2 * pole, 0.026), (1.6 * pole, 0.034)])
    return [Part(mesh=turned(rise), finish="stand"),
            rod((0, 0, 0.034 + GAP), (0, 0, socket - 0.03), pole, finish="stand")]


def _tripod(params: dict[str, float], socket: float) -> list[Part]:
    """Three splayed legs to a hub below the shade, and a short pole up to the socket."""
    hub = 0.80 * (params["height"] - params["shade_height"])
    reach, pole = 0.20 * params["height"], params["pole"] / 2
    plate = max(0.045, 2.6 * pole)
    parts = [foot_disc((0, 0), (hub, hub + 0.02), 2 * plate, finish="stand"),
             rod((0, 0, hub + 0.02 + GAP), (0, 0, socket - 0.03), pole, finish="stand")]
    leg = round_leg((0, -reach), (0, -0.6 * plate), (0, hub - GAP), (0.016, 0.026), finish="stand")
    return [*parts, *(turned_about_z(leg, 120 * k) for k in range(3))]


def _shade(params: dict[str, float], low: float, socket: float) -> list[Part]:
    """Thin shade, open below and above, held by three spokes from the socket."""
    below, above = params["shade_width"] / 2, params["taper"] * params["shade_width"] / 2
    height, wall = params["shade_height"], 0.003
    profile = np.array([(below, 0), (above, height), (above - wall, height), (below - wall, 0)])
    shade = moved(Part(mesh=hoop(profile), finish="shade"), (0, 0, low))
    share = (socket - 0.015 - low) / height
    inside = below + (above - below) * share - wall - 0.003
    hub = max(params["pole"] / 2 + 0.006, 0.016)
    spoke = rod((0, -hub - GAP, socket - 0.015), (0, -inside, socket - 0.015), 0.0025, finish="stand")
    return [shade, *(turned_about_z(spoke, 60 + 120 * k) for k in range(3))]


def _bulb(params: dict[str, float], socket: float) -> list[Part]:
    """Socket on the pole, and a bulb on it."""
    hub = max(params["pole"] / 2 + 0.006, 0.016)
    cup = moved(Part(mesh=disc(hub, 0.03 - 2 * GAP, bevel=0.002, sides=COARSE), finish="stand"),
                (0, 0, socket - 0.03 + GAP))
    size = min(0.03, 0.18 * params["shade_height"], 0.2 * params["taper"] * params["shade_width"])
    angle = np.linspace(-0.88 * np.pi / 2, 0.97 * np.pi / 2, 14)
    globe = np.stack([size * np.cos(angle), size * (np.sin(angle) - np.sin(angle[0]))], axis=-1)
    return [cup, moved(Part(mesh=turned(globe, sides=COARSE), finish="bulb"), (0, 0, socket))]


def vase(params: dict[str, float], finish_rng: np.random.Generator, _: np.random.Generator) -> Made:
    """Turned vase, hollow, with a foot, a belly, a neck and a flared rim; ceramic, stone or glass."""
    makers = (materials.glass,) if params["finish"] else (materials.ceramic, materials.ceramic, materials.stone)
    finishes = {"glaze": materials.one_of(finish_rng, *makers)}
    height, belly, neck = params["height"], params["belly"] / 2, params["neck"] / 2
    knots = np.array([0, params["belly_at"], 0.86, 1.0]) * height
    outline = PchipInterpolator(knots, [0.62 * belly, belly, min(neck, 0.9 * belly), min(1.25 * neck, 0.95 * belly)])
    wall = 0.006
    up = np.linspace(0.004, height - 0.003, 26)
    outer = np.stack([outline(up), up], axis=-1)
    inner = np.stack([outline(up[::-1][:-4]) - wall, up[::-1][:-4]], axis=-1)
    lip = np.array([(outline(height) - 0.002, height), (outline(height) - wall + 0.002, height)])
    profile = np.concatenate([[(outline(0) - 0.004, 0)], outer, lip, inner])
    return [Part(mesh=turned(profile), finish="glaze")], finishes


def plant(params: dict[str, float], finish_rng: np.random.Generator, leaf_rng: np.random.Generator) -> Made:
    """Pot with soil and upright sword-shaped leaves, each in its own sector so that none meet."""
    finishes = {"pot": materials.one_of(finish_rng, materials.ceramic, materials.paint, materials.plaster),
                "soil": materials.soil(finish_rng), "leaf": materials.leaf(finish_rng)}
    radius, height = params["pot_width"] / 2, params["pot_height"]
    wall, level = 0.012, 0.90 * height
    slope = 0.26 * radius / height
    floor = 0.74 * radius
    pot = np.array([(floor - 0.004, 0), (floor, 0.004), (radius - slope * 0.003, height - 0.003),
                    (radius - 0.003, height),
                    (radius - wall + 0.003, height), (radius - wall, height - 0.003),
                    (floor - wall + 0.3 * slope * height, 0.3 * height)])
    bed_radius = floor + slope * (level - 0.02) - wall - 0.002
    soil = moved(Part(mesh=disc(bed_radius, 0.02, bevel=0.003), finish="soil"), (0, 0, level - 0.02))
    return [Part(mesh=turned(pot), finish="pot"), soil, *_leaves(params, bed_radius, level + GAP, leaf_rng)], finishes


def _leaves(params: dict[str, float], room: float, floor: float, rng: np.random.Generator) -> list[Part]:
    """Leaves on a ring, one to a sector, leaning outwards."""
    count = int(params["leaves"])
    ring, parts = 0.62 * room, []
    width = min(0.075, 1.5 * ring * np.sin(np.pi / count))
    for index, leaf_rng in enumerate(rng.spawn(count)):
        length = params["leaf_length"] * leaf_rng.uniform(0.6, 1.0)
        lean, twist = leaf_rng.uniform(0.10, 0.32), leaf_rng.uniform(-8, 8)
        leaf = moved(Part(mesh=_leaf(width, length, lean), finish="leaf"), (0, -ring, floor))
        parts.append(turned_about_z(leaf, 360 * index / count + twist * 3 / count))
    return parts


def _leaf(width: float, length: float, lean: float) -> TriangleMesh:
    """Blade along z, broad side to -Y, tapering to a tip and bending outwards (-Y) by `lean` of its length."""
    steps = np.linspace(0, 1, 15)
    points, quads = lattice_box((np.array([-1.0, 0, 1.0]), np.array([-1.0, 1.0]), steps))
    blade = Part(mesh=solid(points, split_quads(quads)), finish="leaf")

    def shape(p: np.ndarray) -> np.ndarray:
        broad = width / 2 * (0.45 + 2.2 * p[:, 2] * (1 - p[:, 2]) ** 0.6) / 1.25 * (1 - 0.97 * p[:, 2] ** 6)
        fold = 0.35 * broad * np.abs(p[:, 0])
        x, z = p[:, 0] * broad, length * p[:, 2] * (1 - 0.25 * lean * p[:, 2])
        return np.stack([x, p[:, 1] * 0.0018 - fold - lean * length * p[:, 2] ** 2, z], axis=-1)

    bent_blade = bent(blade, shape).mesh
    return solid(bent_blade.positions, bent_blade.faces, grain=2)
