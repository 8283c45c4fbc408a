"""What merging costs: `python benchmarks/merging.py [--examples 1000] [--parts 4] [--kilobytes 250]`.

Parts are written as builds write them, but for their pixels: every example is the same small one under its own key,
with a further file of noise. Prints CPU seconds of reading the parts' records, and of the whole merge.
"""

import argparse
import resource
import tempfile
from dataclasses import replace
from pathlib import Path
from time import perf_counter

from dataset_builder.engine.dataset_part import parts_of, write_record
from dataset_builder.engine.made_by import versions
from dataset_builder.engine.part_set import PartSet
from dataset_builder.merge import merge
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.planning.plan import Planner
from dataset_builder.seeding import rng
from dataset_builder.shards.example import Member, encode_members, preview
from dataset_builder.shards.segment import segment
from dataset_builder.shards.shard_index import ExampleFacts
from dataset_builder.shards.staging import Staging
from dataset_builder.shards.writer import entry
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.resolve import LoadedSpec
from tests.shards.tiny_dataset import make_example
from tests.small_specs import write_spec


def cpu() -> float:
    """CPU seconds of this process so far."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def stage(folder: Path, refs: list[ExampleRef], noise: bytes) -> dict[str, str]:
    """Put examples into staging; digests by key."""
    example = make_example(0)
    members = encode_members(example, dtype="float32", preview_png=preview(example.layers))
    digests = dict[str, str]()
    for ref in refs:
        named = [replace(member, name=f"{ref.key}.{member.name.partition('.')[2]}") for member in members]
        named.append(Member(name=f"{ref.key}.noise.exr", data=noise, pixel_digest=""))
        digests[ref.key] = f"{ref.index:064x}"
        Staging(folder).put(ref.key, digests[ref.key], segment(named),
                            entry(key=ref.key, view=ref.view.name, facts=ExampleFacts.of(example.plan), members=named))
    return digests


def write_parts(loaded: LoadedSpec, planner: Planner, folder: Path, count: int, noise: bytes) -> list[Path]:
    """Folders of all parts."""
    views = list(parts_of(loaded.dataset, planner.examples, count))
    for part in sorted({part for part, _ in views}):
        refs = [ref for found, unit in views if found == part for ref in unit.examples]
        own = folder / str(part.number)
        write_record(own, part, loaded.spec_digest, versions("llvm", loaded.dataset), (), stage(own, refs, noise), ())
    return sorted(folder.iterdir())


def main() -> None:
    """Write parts, merge them, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, value in (("--examples", 1000), ("--parts", 4), ("--kilobytes", 250)):
        parser.add_argument(name, type=int, default=value)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        root, views = Path(scratch), max(options.examples // 3, 1)
        loaded = load_dataset(write_spec(root / "spec"), ("rough.sigma=0.0", "splits.train.lights=1",
                              f"splits.train.views={views}", f"splits.test.views={views}",
                              "storage.examples_per_shard=100"))
        planner = Planner(loaded)
        noise = rng(0, "noise").bytes(1000 * options.kilobytes)
        folders = write_parts(loaded, planner, root / "parts", options.parts, noise)
        start, wall = cpu(), perf_counter()
        PartSet.of(loaded, planner.examples, folders)
        read = cpu() - start
        manifest = [event.manifest for event in merge(loaded, folders, root / "out")][-1]
        assert manifest is not None
        print(f"{manifest.totals.examples} examples, {manifest.totals.bytes / 1e6:.0f} MB in {manifest.totals.shards} "
              f"shards from {len(folders)} parts: records {read:.2f} s, merge {cpu() - start - read:.2f} s of CPU, "
              f"{perf_counter() - wall:.1f} s in all")


if __name__ == "__main__":
    main()
