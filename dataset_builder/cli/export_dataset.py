"""The verb `export`: a dataset in a format of others."""

import argparse

from dataset_builder.cli import common

FORMATS = ("mds", "parquet", "exr", "dali")


def add(verbs: common.Verbs) -> None:
    """Add the verb."""
    verb = common.add_verb(verbs, "export", _export, "write a dataset in a format of others")
    common.add_folder(verb)
    verb.add_argument("out", type=common.out_folder, metavar="OUT",
                      help="folder to make, or where the same export was stopped")
    verb.add_argument("--format", required=True, choices=FORMATS, dest="kind",
                      help="mds (MosaicML streaming), parquet (Hugging Face, DuckDB), exr (a file of all layers for "
                           "each example, for compositors), dali (an index of each tar)")
    verb.add_argument("--split", action="extend", nargs="+", default=[], metavar="NAME", dest="splits",
                      help="only these splits")
    verb.add_argument("--layers", action="extend", nargs="+", default=[], metavar="A,B", help="only these layers")


def _export(options: argparse.Namespace) -> int:
    from dataset_builder.exporting.export_dataset import DatasetExport, export_dataset

    done = export_dataset(DatasetExport(dataset=options.folder, out=options.out, kind=options.kind,
                                        splits=common.names(options.splits), layers=common.names(options.layers)))
    again = f"; {done.kept} of {done.shards} shards were there already" if done.kept else ""
    print(f"{options.out}: {done.examples:,} examples in {done.files:,} files, {done.bytes:,} bytes{again}")
    return 0
