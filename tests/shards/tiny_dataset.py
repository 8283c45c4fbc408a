"""Tiny synthetic examples that keep every identity, and small datasets of them."""

from pathlib import Path
from typing import Literal

import numpy as np

from dataset_builder.digest import digest
from dataset_builder.seeding import rng
from dataset_builder.shards import exr
from dataset_builder.shards.example import Example, encode_members, preview
from dataset_builder.shards.folder import Claim
from dataset_builder.shards.manifest import Manifest, make_manifest, shard_slot
from dataset_builder.shards.one_writer import build_lock
from dataset_builder.shards.publish import publish_dataset, whole_shards
from dataset_builder.shards.segment import segment
from dataset_builder.shards.shard_index import ExampleFacts, ShardIndex
from dataset_builder.shards.staging import Staging
from dataset_builder.shards.writer import entry, publish_shard
from dataset_builder.spec.dataset import DatasetSpec
from tests.plans import PAPER, example_plan, render_record

HEIGHT, WIDTH = 6, 8
Shared = Literal["each", "once"]
VERSIONS = {"renderer": "none"}


def make_layers(view: str, light: int = 0) -> dict[str, np.ndarray]:
    """The six layers of the paper: a square object in the middle of a lit room."""
    fixed, lit = rng(0, view), rng(0, view, light)
    mask = np.zeros((HEIGHT, WIDTH, 1), np.float32)
    mask[1:5, 2:6], mask[2:4, 3:5] = 0.5, 1

    def colours(generator: np.random.Generator, low: float, high: float) -> np.ndarray:
        return generator.uniform(low, high, (HEIGHT, WIDTH, 3)).astype(np.float32)

    covered = (mask > 0).astype(np.float32)
    return {
        "i_s": colours(fixed, 0, 1), "d": colours(fixed, 0.1, 0.7) * covered, "r": colours(fixed, 0, 0.2) * covered,
        "i_t": colours(lit, 0, 4), "s_prime": colours(lit, 0.5, 3) * covered, "mask": mask,
    }


def make_example(index: int = 0, *, split: str = "train", view: str = "", light: int = 0,
                 layers: dict[str, np.ndarray] | None = None) -> Example:
    """Example `index`; examples of the same view share their light-free layers."""
    plan = example_plan(index, split=split, view=view, light=light)
    chosen = make_layers(plan.view, light) if layers is None else layers
    return Example(plan=plan, record=render_record(passes=[{"name": "rough"}], roughness_rms=1e-05), layers=chosen)


def make_spec(dtype: exr.DType = "float32", shared: Shared = "each") -> DatasetSpec:
    """A dataset of two splits, two examples per shard."""
    splits = [{"name": name, "objects": {"from": ["stool.yaml"], "count": 1},
               "scenes": {"from": ["room.yaml"], "count": 1}} for name in ("train", "test")]
    return DatasetSpec.model_validate({
        "name": "tiny", "version": "1.0.0", "title": "Tiny", "licence": "CC0-1.0",
        "image": {"width": WIDTH, "height": HEIGHT},
        "layers": dict(PAPER), "splits": splits,
        "storage": {"dtype": dtype, "examples_per_shard": 2, "shared": shared},
    })


SHARDS: dict[tuple[str, int], tuple[int, ...]] = {("train", 0): (0, 1), ("train", 1): (2,), ("test", 0): (3,)}
VIEWS = {0: ("train/000000", 0), 1: ("train/000000", 1), 2: ("train/000002", 0), 3: ("test/000003", 0)}


def plan_digest(example: Example) -> str:
    """What a finished example is kept under."""
    return digest([example.plan.model_dump(mode="json"), VERSIONS])


def stage(folder: Path, example: Example, dtype: exr.DType = "float32") -> tuple[str, str]:
    """Put one example into staging unless it is there; its key and digest."""
    staging, name = Staging(folder), plan_digest(example)
    if not staging.has(example.key, name):
        members = encode_members(example, dtype=dtype, preview_png=preview(example.layers))
        staging.put(example.key, name, segment(members),
                    entry(key=example.key, view=example.plan.view, facts=ExampleFacts.of(example.plan),
                          members=members))
    return example.key, name


def default_examples() -> dict[int, Example]:
    """Four examples, of which the first two share a view."""
    return {index: make_example(index, split="test" if index == 3 else "train", view=view, light=light)
            for index, (view, light) in VIEWS.items()}


def build(folder: Path, examples: dict[int, Example] | None = None, *, dtype: exr.DType = "float32",
          shards: dict[tuple[str, int], tuple[int, ...]] = SHARDS, shared: Shared = "each") -> Manifest:
    """Build the small dataset as a real build does: keep what is done, stage, publish, `dataset.json` last."""
    examples, spec = examples or default_examples(), make_spec(dtype, shared)
    with build_lock(folder, Claim(name=spec.name, version=spec.version)):
        indexes = [_shard(folder, spec, split, number, [examples[index] for index in members], dtype)
                   for (split, number), members in shards.items()]
        manifest = make_manifest(spec, layers=dict(PAPER), shards=indexes, rejected=(), spec_digest=digest("tiny"),
                                 generator="dataset-builder test")
        publish_dataset(folder, manifest)
        Staging(folder).clear()
    return manifest


def _shard(folder: Path, spec: DatasetSpec, split: str, number: int, examples: list[Example],
           dtype: exr.DType) -> ShardIndex:
    slot, wanted = shard_slot(spec, split, number), [(example.key, plan_digest(example)) for example in examples]
    for done in whole_shards(folder):
        if done.shard.slot == slot and [(example.key, example.digest) for example in done.examples] == wanted:
            return done
    staged = [stage(folder, example, dtype) for example in examples]
    return publish_shard(folder, slot=slot, split=split, examples=staged, spec_digest=digest("tiny"), versions=VERSIONS,
                         share=spec.storage.shared == "once")


def shard_path(folder: Path, slot: str) -> Path:
    """The shard in `slot`, such as `tiny-v1-train-000000`, whatever its tag; or where it would be without one."""
    return next((folder / "shards").glob(f"{slot}-????????.tar"), folder / "shards" / f"{slot}.tar")


def index_path(folder: Path, slot: str) -> Path:
    """The index of the shard in `slot`, whatever its tag."""
    return next((folder / "index").glob(f"{slot}-????????.manifest"), folder / "index" / f"{slot}.manifest")


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of a dataset by relative name, but for the builder's own folder."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in sorted(folder.rglob("*"))
            if path.is_file() and ".build" not in path.relative_to(folder).parts}
