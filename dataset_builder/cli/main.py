"""The command line: parse, call, print. Exit codes: 0 done, 1 a check failed, 2 the user can correct it."""

import argparse
import sys
from collections.abc import Sequence

from dataset_builder import __version__
from dataset_builder.cli import (
    build,
    evaluate,
    export,
    export_dataset,
    export_field,
    import_capture,
    import_front3d,
    import_models,
    inspect,
    integrity,
    study,
    table,
    transfer,
    view,
)
from dataset_builder.cli.interrupt import guarded
from dataset_builder.errors import UserError
from dataset_builder.extras import missing_named


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb; returns the exit code."""
    options = parser().parse_args(_one_verb(sys.argv[1:] if arguments is None else arguments))
    try:
        with missing_named():
            return guarded(lambda: options.run(options))
    except UserError as error:
        for problem in error.problems:
            print(f"error: {problem}", file=sys.stderr)
        return 2
    except MemoryError:
        print("error: no memory is left; finished examples are kept (fewer --workers, smaller images, or a machine "
              "with more memory)", file=sys.stderr)
        return 1
    except BrokenPipeError:
        return 0


def _one_verb(arguments: Sequence[str]) -> list[str]:
    """The command line with a verb of two words as one."""
    return import_capture.one_verb(import_front3d.one_verb(arguments))


def parser() -> argparse.ArgumentParser:
    """All verbs and their options."""
    root = argparse.ArgumentParser(prog="dataset-builder", description="Build 3DF-Lighting datasets from specs.")
    root.add_argument("--version", action="version", version=__version__)
    verbs = root.add_subparsers(required=True, metavar="VERB")
    for group in (import_models, import_capture, import_front3d, view, build, inspect, integrity, transfer, export,
                  export_dataset, export_field, study, evaluate, table):
        group.add(verbs)
    return root
