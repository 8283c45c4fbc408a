"""The verb `export-field`: a field as splats, or as its mesh, for other programs."""

import argparse
from pathlib import Path

from dataset_builder.cli import common


def add(verbs: common.Verbs) -> None:
    """Add the verb."""
    verb = common.add_verb(verbs, "export-field", _export, "write a field as Gaussian splats, or as its mesh")
    verb.add_argument("field", type=Path, metavar="FIELD", help="file of a field, such as captures/chair.npz")
    verb.add_argument("out", type=common.out_folder, metavar="OUT",
                      help="file to write: .ply, .glb, .usda, .usdc or .usd")
    kind = verb.add_mutually_exclusive_group()
    kind.add_argument("--splats", action="store_const", dest="content", const="splats",
                      help="Gaussian splats (the default, but for .glb)")
    kind.add_argument("--mesh", action="store_const", dest="content", const="mesh",
                      help="the mesh with colours at its vertices")


def _export(options: argparse.Namespace) -> int:
    from dataset_builder.exporting.export_field import export_field

    done = export_field(options.field, options.out, options.content)
    what = "triangles" if done.content == "mesh" else "splats" + ", one for each vertex of its mesh" * done.made
    print(f"{options.out}: {done.count:,} {what}")
    return 0
