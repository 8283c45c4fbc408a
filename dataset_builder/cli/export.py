"""The verb `export-usd`: an example of a dataset as a stage for Blender, Omniverse or usdview."""

import argparse
from pathlib import Path

from dataset_builder.cli import common
from dataset_builder.errors import printable


def add(verbs: common.Verbs) -> None:
    """Add the verb."""
    verb = common.add_verb(verbs, "export-usd", _export, "write an example of a dataset as a USD stage")
    common.add_folder(verb)
    verb.add_argument("key", metavar="KEY", help="key of the example, such as 00000012")
    verb.add_argument("--out", type=common.out_folder, metavar="DIR",
                      help="folder for the stage, its textures and its layers (default: DATASET-KEY-usd, here)")
    verb.add_argument("--meshes", type=Path, default=Path(), metavar="DIR",
                      help="folder of the dataset's spec, where mesh files and images are looked for (default: here)")
    verb.add_argument("--fields", type=Path, metavar="DIR",
                      help="folder of the fields that rough meshes were taken from (default: the dataset's own)")


def _export(options: argparse.Namespace) -> int:
    from dataset_builder.exporting.export_usd import ExportJob, export_usd

    out = options.out or Path(f"{options.folder.resolve().name}-{options.key}-usd")
    done = export_usd(ExportJob(dataset=options.folder, key=options.key, out=out, mesh_root=options.meshes,
                                 fields=options.fields))
    for what in done.not_said:
        print(f"not in the stage: {printable(what)}")
    print(f"{done.things} things, {done.triangles:,} triangles, {len(done.layers)} layers")
    print(f"stage: {done.stage}")
    return 0
