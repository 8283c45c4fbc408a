"""Finished datasets of views that go round a ball or a box, by formulas: depth is exact, and the light stays."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from dataset_builder.digest import digest
from dataset_builder.label.scene_plan import CameraPlan
from dataset_builder.label.sequence_plan import SequencePlan
from dataset_builder.seeding import rng
from dataset_builder.shards.example import Example
from dataset_builder.shards.folder import Claim
from dataset_builder.shards.manifest import make_manifest
from dataset_builder.shards.one_writer import build_lock
from dataset_builder.shards.publish import publish_dataset
from dataset_builder.shards.staging import Staging
from dataset_builder.spec.dataset import DatasetSpec
from tests.lightnet.synthetic import CENTRE, RADIUS, Light, Shape, camera_frame, glint, publish, shading, trace
from tests.plans import example_plan, object_plan, render_record

LAYERS = ("i_s", "d", "r", "i_t", "s_prime", "mask", "depth")
LIGHT = Light(ambient=np.full(3, 0.25), lamp=np.full(3, 2.4), direction=np.array([0.48, -0.6, 0.64]))
EVERYWHERE_LIT = np.zeros(3)


def write_turning(folder: Path, *, frames: int = 5, step: float = 12.0, size: int = 48, sequences: int = 1,
                  missing: tuple[int, ...] = (), gloss: float = 0.0, train: int = 2, turned: float = 0.0) -> Path:
    """Write splits `train`, single views, and `turn`: `sequences` of `frames` views each, `step` degrees apart, but for
    those `missing` of the first. gloss: weight of a highlight, without which the object is matte. turned: degrees that
    the world of a view is turned by against the one before, target and camera, which changes no picture."""
    spec = _spec(size)
    singles = [_example(k, "train", 40.0 * k, size, gloss, SequencePlan()) for k in range(train)]
    turning = [_world_turned(_example(train + s * frames + k, "turn", 90.0 * s + step * k, size, gloss,
                                      SequencePlan(name=f"turn-{s:02d}-00", frame=k, frames=frames), s), turned * k)
               for s in range(sequences) for k in range(frames) if s or k not in missing]
    with build_lock(folder, Claim(name=spec.name, version=spec.version)):
        shards = [publish(folder, spec, split, 0, examples) for split, examples in (("train", singles),
                                                                                   ("turn", turning))]
        publish_dataset(folder, make_manifest(spec, layers=dict(spec.layers), shards=shards, rejected=(),
                                              spec_digest=digest("turning"), generator="formulas"))
        Staging(folder).clear()
    return folder


def _example(index: int, split: str, azimuth: float, size: int, gloss: float, place: SequencePlan,
             number: int = 0) -> Example:
    shape = Shape(kind="sphere", half=np.full(3, RADIUS), yaw=0.0) if number % 2 == 0 else Shape(
        kind="box", half=RADIUS * np.array([0.6, 0.7, 0.8]), yaw=0.3)
    camera = _camera(azimuth)
    mask, normal, spot = trace(shape, camera, size, 1.0)
    covered = mask > 0
    depth = np.where(covered, (CENTRE + RADIUS * spot - camera.position) @ -camera_frame(camera)[2][:, None], 0)
    d, r = 0.6 * np.ones(3) * covered, gloss * np.ones(3) * covered
    s = shading(normal, spot, LIGHT, EVERYWHERE_LIT) * covered
    tilted = normal + 0.2 * rng(7, index).normal(size=normal.shape)
    tilted /= np.linalg.norm(tilted, axis=2, keepdims=True)
    layers = {"mask": mask, "depth": depth, "d": d, "r": r, "i_t": d * s + r * glint(normal, camera, LIGHT) * covered,
              "i_s": d * (0.75 + 0.25 * normal[..., 2:]),
              "s_prime": shading(tilted, spot, LIGHT, EVERYWHERE_LIT) * covered}
    plan = example_plan(index, split=split, width=size, height=size)
    target = plan.target.model_copy(update={"object": object_plan(f"{split}-{shape.kind}-{number:02d}", shape.kind)})
    return Example(plan=plan.model_copy(update={"camera": camera, "sequence": place, "target": target}),
                   record=render_record(lighting_sh=LIGHT.sh().tolist()),
                   layers={name: np.ascontiguousarray(layers[name], np.float32) for name in LAYERS})


def _world_turned(example: Example, angle: float) -> Example:
    """The same in a world turned about +Z by degrees."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))

    def moved(point: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z = point
        return float(c * x - s * y), float(s * x + c * y), z

    plan, camera, target = example.plan, example.plan.camera, example.plan.target
    return replace(example, plan=plan.model_copy(update={
        "camera": camera.model_copy(update={"position": moved(camera.position), "target": moved(camera.target)}),
        "target": target.model_copy(update={"position": moved(target.position), "yaw": target.yaw + angle})}))


def _camera(azimuth: float) -> CameraPlan:
    a, e = np.radians(azimuth), np.radians(25.0)
    position = CENTRE + 1.1 * np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    return CameraPlan(position=tuple(map(float, position)), target=tuple(map(float, CENTRE)), up=(0.0, 0.0, 1.0),
                      fov=40.0, coverage=0.25, visibility=1.0)


def _spec(size: int) -> DatasetSpec:
    split = {"objects": {"from": ["stool.yaml"], "count": 1}, "scenes": {"from": ["room.yaml"], "count": 1}}
    return DatasetSpec.model_validate({
        "name": "turning", "title": "Turning", "image": {"width": size, "height": size},
        "layers": dict.fromkeys(LAYERS, "object"), "splits": [{"name": name, **split} for name in ("train", "turn")]})
