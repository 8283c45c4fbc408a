"""What `inspect` does with a single example: its layers as a page and a picture, its meshes as a picture."""

import argparse
from pathlib import Path

from dataset_builder.cli import common
from dataset_builder.errors import UserError, count_of


def add_one(inspect: argparse.ArgumentParser) -> None:
    """Add the options."""
    inspect.add_argument("--example", metavar="KEY", help="write a page and a picture of all layers of an example, "
                         "by its key, index or place in a split (00000012, 12, train:0), and nothing else")
    inspect.add_argument("--mesh", metavar="KEY", help="write a picture of the 3DM, of the R3DM of every noise "
                         "level and of the distances between them, for an example's view, and nothing else")
    inspect.add_argument("--out", type=common.out_folder, metavar="DIR", help="folder for both (default: previews in "
                         "the dataset; here for one at an address)")
    inspect.add_argument("--meshes", type=Path, metavar="DIR", help="for --mesh: folder of the "
                         "dataset's spec, where mesh files are looked for (default: here)")
    inspect.add_argument("--fields", type=Path, metavar="DIR", help="for --mesh: folder of the fields that rough "
                         "meshes were taken from (default: the dataset's own)")


def inspect_one(options: argparse.Namespace) -> bool:
    """Do what the options ask for; whether they asked for anything. Raises UserError for one that has no use."""
    from dataset_builder.report.one_example import look_at_example, previews_of

    for option, value, wanted in (("--out", options.out, ("example", "mesh")), ("--meshes", options.meshes, ("mesh",)),
                                  ("--fields", options.fields, ("mesh",))):
        if value and not any(getattr(options, name) for name in wanted):
            raise UserError(f"{option}: expected {' or '.join(f'--{name} KEY' for name in wanted)} with it, got none")
    if options.example:
        found = look_at_example(options.folder, options.example, options.out)
        print(f"page: {found.page}\npicture: {found.picture or 'none, without pixels'}")
    if options.mesh:
        from dataset_builder.report.looking.level_meshes import fields_of_dataset, view_meshes
        from dataset_builder.report.mesh_sheet import write_mesh_sheet

        fields = options.fields or fields_of_dataset(options.folder)
        meshes = view_meshes(options.folder, options.mesh, options.meshes or Path(), fields)
        target = (options.out or previews_of(options.folder)) / f"{meshes.own.key}-mesh.png"
        write_mesh_sheet(meshes, target)
        for line in [*meshes.missing, f"picture of {count_of(len(meshes.levels), 'noise level')}: {target}"]:
            common.plain_console().print(line, highlight=False, soft_wrap=True)
    return bool(options.example or options.mesh)
