"""A dataset small enough to be built in seconds, and its builds, for tests that go the whole way."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from dataset_builder.builder import Event, build
from dataset_builder.engine.unit import Outcome
from dataset_builder.shards.manifest import Manifest
from dataset_builder.shards.publish import published
from dataset_builder.shards.reader import load_manifest
from dataset_builder.shards.shard_index import ExampleRecord
from dataset_builder.spec.load import load_dataset

FILES = {
    "small.yaml": """\
name: small
seed: 1
image: {width: 24, height: 20}
layers: {i_s: frame, i_t: frame, d: object, r: object, s_prime: object, mask: object, s: object, spec: object,
         mask_rough: object, depth: frame, normal: object, normal_rough: object, instance: object}
render:
  spp: 16
  max_depth: 4
rough: {sigma: [0.0, 0.006], edge_length: 0.2, rounds: 0}
camera: {azimuth: {uniform: [-180, 180]}, elevation: {uniform: [10, 40]}, coverage: [0.1, 0.5]}
storage: {examples_per_shard: 3}
splits:
  - name: train
    objects: {count: 2, from: [objects/cabinet.yaml, objects/nightstand.yaml]}
    scenes: {count: 1, from: [scenes/den.yaml]}
    lights: 2
  - name: test
    objects: {count: 1, from: [objects/ottoman.yaml]}
    scenes: {count: 1, from: [scenes/den.yaml]}
""",
    "objects/cabinet.yaml": "family: cabinet\n",
    "objects/nightstand.yaml": "family: nightstand\n",
    "objects/ottoman.yaml": "family: ottoman\n",
    "objects/stool.yaml": "family: stool\n",
    "rooms/den.yaml": "width: 4\ndepth: {uniform: [3.5, 4]}\nheight: 2.5\nwindows: 1\n",
    "scenes/den.yaml": "room: ../rooms/den.yaml\nfurniture:\n  - {object: ../objects/stool.yaml, place: near}\n",
}
"""Ten examples: two training views under two lights each and one test view, all at two noise levels."""

VIEW = (0, 1, 2, 3)
"""Examples of the first view: light 0 at both noise levels, then light 1."""


def write_spec(folder: Path, changed: Mapping[str, str | bytes] | None = None) -> Path:
    """The small dataset's files in `folder`, some of them replaced or added; the path of its dataset file."""
    for name, content in {**FILES, **(changed or {})}.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder / "small.yaml"


def run_build(spec: Path, folder: Path, *overrides: str, workers: int = 1, only: Sequence[int] = ()) -> list[Event]:
    """Build in this process (one worker) or in several; all news of the build."""
    return list(build(load_dataset(spec, overrides), folder, backend="llvm", workers=workers, only=only))


def outcomes_of(events: Sequence[Event]) -> dict[int, Outcome]:
    """What became of every example that a build had to make, by index."""
    return {outcome.ref.index: outcome for event in events for outcome in event.outcomes}


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of a dataset by relative name, but for the builder's own folder, previews and seconds."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in sorted(folder.rglob("*"))
            if path.is_file() and not {".build", "previews", "seconds.csv"} & set(path.relative_to(folder).parts)}


def records(folder: Path, manifest: Manifest | None = None) -> dict[str, ExampleRecord]:
    """Entries of all examples of a finished dataset, by key."""
    indexes = [published(folder, shard.stem) for shard in (manifest or load_manifest(folder)).shards]
    return {example.key: example for index in indexes if index for example in index.examples}


def slots(folder: Path) -> list[str]:
    """Names of all shards in a folder without their tags, sorted."""
    return sorted(path.stem.rpartition("-")[0] for path in (folder / "shards").iterdir())
