"""Bytes that subsets of a dataset want, and bytes that are fetched for them: python benchmarks/subset_pulls.py DIR

Counted where a place is asked, and at an http server of this machine: what its answers have, headers left out.
"""

import argparse
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

from dataset_builder.shards.reader import load_manifest, open_dataset  # noqa: E402
from dataset_builder.transfer.choice import ExampleChoice  # noqa: E402
from dataset_builder.transfer.pull import pull  # noqa: E402
from tests.fault_proxy import Plan, fault_proxy  # noqa: E402
from tests.file_servers import range_server  # noqa: E402


def choices(folder: Path) -> dict[str, ExampleChoice]:
    """Some that fit any dataset."""
    dataset = open_dataset(folder)
    splits = list(dataset.splits)
    label = dataset.label(dataset.splits[splits[0]][0])
    first = tuple(dataset.layers[:1])
    return {"everything": ExampleChoice(), f"--split {splits[-1]}": ExampleChoice(split=(splits[-1],)),
            "--object (the first)": ExampleChoice(object=(label.plan.target.object.name,)),
            "--level 0": ExampleChoice(level=("0",)), "--light 0": ExampleChoice(light=("0",)),
            "--count 4": ExampleChoice(count=4), f"--layers {first[0]}": ExampleChoice(layers=first),
            f"--layers {first[0]} --light 0": ExampleChoice(layers=first, light=("0",))}


def main() -> None:
    """Print a row for every choice."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    whole = load_manifest(folder).totals
    print(f"{whole.examples} examples in {whole.shards} shards, {whole.bytes} bytes\n")
    print("| choice | examples | wanted | fetched of shards | more than wanted | of all bytes | with indexes |\n"
          "| --- | --- | --- | --- | --- | --- | --- |")
    for name, choice in choices(folder).items():
        plan = Plan(rate=0.0)
        with tempfile.TemporaryDirectory() as out, range_server(folder) as upstream, \
                fault_proxy(upstream, plan) as address:
            pulled = pull(address, Path(out) / "here", choice=choice)
        sent = sum(one.sent for one in plan.served if one.path.endswith(".tar"))
        both = sum(one.sent for one in plan.served if one.path.endswith((".tar", ".manifest")))
        assert both == pulled.moved
        print(f"| `{name}` | {pulled.manifest.totals.examples} | {pulled.wanted} | {sent} | "
              f"{sent / pulled.wanted - 1:.2%} | {sent / whole.bytes:.1%} | {both} |")


if __name__ == "__main__":
    main()
