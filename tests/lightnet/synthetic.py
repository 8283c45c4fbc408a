"""Finished datasets without rendering: spheres and boxes under a lamp, traced and shaded by formulas.

Every example keeps I_t = D S + spec to float32 rounding wherever the mask is above 0, with S and spec as layers to ask
for. S' is S on a mesh whose facets are tilted at random, more so at higher noise levels.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dataset_builder import __version__
from dataset_builder.digest import digest
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.label.scene_plan import CameraPlan
from dataset_builder.seeding import rng
from dataset_builder.shards.example import Example, encode_members, preview
from dataset_builder.shards.folder import Claim
from dataset_builder.shards.manifest import make_manifest, shard_slot
from dataset_builder.shards.one_writer import build_lock
from dataset_builder.shards.publish import publish_dataset
from dataset_builder.shards.segment import segment
from dataset_builder.shards.shard_index import ExampleFacts, ShardIndex
from dataset_builder.shards.staging import Staging
from dataset_builder.shards.writer import entry, publish_shard
from dataset_builder.spec.dataset import DatasetSpec
from tests.plans import example_plan, object_plan, render_record

PAPER_AND_ROUGH = ("i_s", "d", "r", "i_t", "s_prime", "mask", "mask_rough")
OBJECT = ("d", "r", "s_prime", "mask", "s", "spec", "mask_rough")
CENTRE = np.array([0.1, 0.2, 0.4])
RADIUS, SWELLING, FINE = 0.25, 1.04, 3
SIGMA, TILT = 0.016, 65.0
"""Largest vertex noise, and the deviation of a facet's normal per unit of it."""
GLOSS = 24
"""Exponent of the normalised Blinn-Phong lobe."""


@dataclass(frozen=True, kw_only=True)
class Light:
    """ambient (3,): radiance from everywhere; lamp (3,): irradiance on a surface that faces `direction` (3,)."""

    ambient: np.ndarray
    lamp: np.ndarray
    direction: np.ndarray

    def sh(self) -> np.ndarray:
        """(9, 3) spherical harmonics of the radiance that arrives, world axes."""
        x, y, z = self.direction
        basis = np.array([0.5, np.sqrt(3 / 4) * y, np.sqrt(3 / 4) * z, np.sqrt(3 / 4) * x, np.sqrt(15 / 4) * x * y,
                          np.sqrt(15 / 4) * y * z, np.sqrt(5 / 16) * (3 * z * z - 1), np.sqrt(15 / 4) * x * z,
                          np.sqrt(15 / 16) * (x * x - y * y)]) / np.sqrt(np.pi)
        constant = np.zeros((9, 1))
        constant[0] = np.sqrt(4 * np.pi)
        return basis[:, None] * self.lamp + constant * self.ambient


@dataclass(frozen=True, kw_only=True)
class Shape:
    """A sphere or a box: half lengths along its axes, and its turn about Z in radians."""

    kind: str
    half: np.ndarray
    yaw: float


def write_synthetic(folder: Path, *, train: int = 6, held_out: int = 3, size: int = 48, levels: int = 1, seed: int = 0,
                    layers: Sequence[str] = PAPER_AND_ROUGH, per_shard: int = 4,
                    splits: Mapping[str, int] | None = None) -> Path:
    """Write a finished dataset with the splits `train` and `evaluation`; returns its folder.

    train, held_out: examples of each split; or, by name, splits. levels: noise levels; neighbouring examples are the
    levels of one view under one light. layers: those of the paper, `mask_rough`, `s`, `spec`, `i_t_empty`, `i_pbr`, and
    `i_t_se`, `i_t_half`, `i_s_clean`, with which labels say that `i_s` is the image of a field.
    """
    counts, named = dict[str, range](), {"train": train, "evaluation": held_out} if splits is None else splits
    for name, count in named.items():
        start = sum(map(len, counts.values()))
        counts[name] = range(start, start + count)
    spec = _spec(layers, size, per_shard, tuple(counts))
    with build_lock(folder, Claim(name=spec.name, version=spec.version)):
        indexes = []
        for split, indices in counts.items():
            for number in range(0, len(indices), per_shard):
                examples = [synthetic_example(index, split, size=size, levels=levels, seed=seed, layers=layers)
                            for index in indices[number:number + per_shard]]
                indexes.append(publish(folder, spec, split, number // per_shard, examples))
        publish_dataset(folder, make_manifest(spec, layers=dict(spec.layers), shards=indexes, rejected=(),
                                              spec_digest=digest("synthetic"), generator="formulas"))
        Staging(folder).clear()
    return folder


def synthetic_example(index: int, split: str = "train", *, size: int = 48, levels: int = 1, seed: int = 0,
                      layers: Sequence[str] = PAPER_AND_ROUGH) -> Example:
    """Example `index`; it depends on the arguments alone."""
    view, level = f"{split}/{index // levels:06d}", index % levels
    stream = rng(seed, view)
    shape, camera, light = _shape(stream, index // levels), _camera(stream), _light(stream)
    sigma = SIGMA * (level + 1) / levels
    made = _layers(shape, camera, light, size=size, sigma=sigma, look=stream, noise=rng(seed, view, "noise", level))
    plan = _plan(index, split, view, shape, camera, size, level, sigma)
    if "i_s_clean" in layers:
        plan = plan.model_copy(update={"field": FieldPlan(kind="density")})
    record = render_record(lighting_sh=light.sh().tolist(), roughness_rms=0.8 * sigma, roughness_max=2.5 * sigma,
                           bounding_radius=float(np.linalg.norm(shape.half)))
    return Example(plan=plan, record=record,
                   layers={name: np.ascontiguousarray(made[name], np.float32) for name in layers})


def camera_frame(camera: CameraPlan) -> np.ndarray:
    """(3, 3) rows x (right), y (up), z (to the viewer) of a camera, in the world."""
    back = np.subtract(camera.position, camera.target)
    z = back / np.linalg.norm(back)
    x = np.cross(camera.up, z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def _shape(stream: np.random.Generator, number: int) -> Shape:
    if number % 2:
        return Shape(kind="sphere", half=np.full(3, RADIUS * stream.uniform(0.8, 1.0)), yaw=0.0)
    return Shape(kind="box", half=RADIUS * stream.uniform(0.5, 0.8, 3), yaw=float(stream.uniform(0, np.pi)))


def _camera(stream: np.random.Generator) -> CameraPlan:
    azimuth, elevation = stream.uniform(0, 2 * np.pi), np.radians(stream.uniform(10, 50))
    towards = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    aim = CENTRE + stream.uniform(-0.05, 0.05, 3)
    position = aim + 1.1 * towards
    return CameraPlan(position=tuple(map(float, position)), target=tuple(map(float, aim)), up=(0.0, 0.0, 1.0), fov=40.0,
                      coverage=0.25, visibility=1.0)


def _light(stream: np.random.Generator) -> Light:
    direction = stream.normal(size=3) + np.array([0.0, 0.0, 0.7])
    power = np.exp(stream.uniform(-0.7, 0.7))
    return Light(ambient=power * stream.uniform(0.15, 0.3, 3), lamp=power * np.pi * stream.uniform(0.7, 1.0, 3),
                 direction=direction / np.linalg.norm(direction))


def trace(shape: Shape, camera: CameraPlan, size: int, scale: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mask (H, W, 1), unit normals and places relative to the centre in radii (H, W, 3), means of FINE^2 rays."""
    x, y, z = camera_frame(camera)
    steps = ((np.arange(size * FINE) + 0.5) / (size * FINE) * 2 - 1) * np.tan(np.radians(camera.fov) / 2)
    rays = steps[None, :, None] * x - steps[:, None, None] * y - z
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    c, s = np.cos(shape.yaw), np.sin(shape.yaw)
    own_from_world = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    origin = own_from_world @ (np.array(camera.position) - CENTRE) / (shape.half * scale)
    ways = rays @ own_from_world.T / (shape.half * scale)
    hit, own, normal = _unit_sphere(origin, ways) if shape.kind == "sphere" else _unit_box(origin, ways)
    world = [np.where(hit[..., None], value @ own_from_world, 0)
             for value in (normal / shape.half, own * shape.half * scale / RADIUS)]
    mask, normals, places = (value.reshape(size, FINE, size, FINE, -1).mean((1, 3))
                             for value in (hit[..., None].astype(float), *world))
    return mask, normals / np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-9), places / np.maximum(
        mask, 1e-9)


def _unit_sphere(origin: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    a, b, c = (ways * ways).sum(2), ways @ origin, origin @ origin - 1
    root = b * b - a * c
    place = origin + ways * ((-b - np.sqrt(np.maximum(root, 0))) / a)[..., None]
    return root > 0, place, place


def _unit_box(origin: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack([(-1 - origin) / ways, (1 - origin) / ways])
    near, far = ends.min(0), ends.max(0)
    axis, t = near.argmax(2), near.max(2)
    normal = -np.sign(ways) * np.eye(3)[axis]
    return t < far.min(2), origin + ways * t[..., None], normal


def _layers(shape: Shape, camera: CameraPlan, light: Light, *, size: int, sigma: float, look: np.random.Generator,
            noise: np.random.Generator) -> dict[str, np.ndarray]:
    mask, normal, place = trace(shape, camera, size, 1.0)
    mask_rough, swollen, rough_place = trace(shape, camera, size, SWELLING)
    either = (mask > 0) | (mask_rough > 0)
    rough_normal = np.where(mask_rough > 0, swollen, normal) + TILT * sigma * _facets(noise, size)
    rough_normal /= np.linalg.norm(rough_normal, axis=2, keepdims=True)
    shadow = look.normal(size=3)
    covered = mask > 0
    d = (np.where(np.sin(11 * place @ look.normal(size=3)) > 0, 1.0, 0.5)[..., None] * look.uniform(0.3, 0.75, 3)
         * covered).astype(np.float32)
    r = (look.uniform(0.03, 0.12) * (1 + 0.5 * place[..., 2:]) * np.ones(3) * covered).astype(np.float32)
    s = (shading(normal, place, light, shadow) * covered).astype(np.float32)
    spec = (r * glint(normal, camera, light) * covered).astype(np.float32)
    wall = np.linspace(0.8, 0.3, size)[:, None, None] * np.ones((1, size, 3))
    dome, behind, lit = 0.75 + 0.25 * normal[..., 2:], wall * light.ambient, covered * (d * s + spec)
    s_prime = shading(rough_normal, np.where(mask_rough > 0, rough_place, place), light, shadow) * either
    i_s = np.where(covered, d * dome + 0.8 * r * dome, wall)
    return {"mask": mask, "mask_rough": mask_rough, "d": d, "r": r, "s": s, "spec": spec,
            "i_t": np.where(covered, d * s + spec, behind),
            "i_t_empty": behind, "i_pbr": np.where(mask_rough > 0, 0.5 * s_prime, behind), "s_prime": s_prime,
            "i_s": i_s, "i_s_clean": 0.8 * i_s, "i_t_se": 0.1 * lit, "i_t_half": 0.9 * lit}


def _facets(noise: np.random.Generator, size: int) -> np.ndarray:
    """(H, W, 3) unit normal deviates, constant over facets of three pixels."""
    side = -(-size // 3)
    return noise.normal(size=(side, side, 3)).repeat(3, 0).repeat(3, 1)[:size, :size]


def shading(normal: np.ndarray, place: np.ndarray, light: Light, shadow: np.ndarray) -> np.ndarray:
    """What a white Lambertian surface sends back; a soft shadow lies over one side of the object."""
    lit = 0.3 + 0.7 / (1 + np.exp(-4 * (place @ shadow + 0.4)))
    return light.ambient + np.maximum(normal @ light.direction, 0)[..., None] * lit[..., None] * light.lamp / np.pi


def glint(normal: np.ndarray, camera: CameraPlan, light: Light) -> np.ndarray:
    """Radiance that a glossy lobe gathers."""
    half = light.direction + camera_frame(camera)[2]
    lobe = np.maximum(normal @ (half / np.linalg.norm(half)), 0) ** GLOSS * (GLOSS + 2) / (2 * np.pi)
    return light.ambient + np.minimum(lobe, 2.0)[..., None] * light.lamp / np.pi


def _plan(index: int, split: str, view: str, shape: Shape, camera: CameraPlan, size: int, level: int,
          sigma: float) -> ExamplePlan:
    plan = example_plan(index, split=split, view=view, width=size, height=size, sigma=sigma)
    target = plan.target.model_copy(update={"object": object_plan(f"{split}-{shape.kind}-00", shape.kind)})
    return plan.model_copy(update={"camera": camera, "target": target,
                                   "rough": plan.rough.model_copy(update={"level": level})})


def _spec(layers: Sequence[str], size: int, per_shard: int, names: Sequence[str]) -> DatasetSpec:
    splits = [{"name": name, "objects": {"from": ["stool.yaml"], "count": 1},
               "scenes": {"from": ["room.yaml"], "count": 1}} for name in names]
    return DatasetSpec.model_validate({
        "name": "synthetic", "title": "Synthetic", "image": {"width": size, "height": size},
        "layers": {name: "object" if name in OBJECT else "frame" for name in layers},
        "storage": {"examples_per_shard": per_shard}, "splits": splits,
    })


def publish(folder: Path, spec: DatasetSpec, split: str, number: int, examples: Sequence[Example]) -> ShardIndex:
    staging, staged = Staging(folder), []
    for example in examples:
        name = digest([example.plan.model_dump(mode="json"), __version__])
        members = encode_members(example, dtype="float32", preview_png=preview(example.layers))
        staging.put(example.key, name, segment(members),
                    entry(key=example.key, view=example.plan.view, facts=ExampleFacts.of(example.plan),
                          members=members))
        staged.append((example.key, name))
    return publish_shard(folder, slot=shard_slot(spec, split, number), split=split, examples=staged,
                         spec_digest=digest("synthetic"), versions={"renderer": "none"})
