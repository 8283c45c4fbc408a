"""`python -m dataset_builder` is the command `dataset-builder`."""

from dataset_builder.cli.interrupt import guarded, leave


def run() -> None:
    """Run the command line and end the process with its exit code."""
    leave(guarded(_main))


def _main() -> int:
    # Ctrl-C may strike while verbs are imported
    from dataset_builder.cli.main import main

    return main()


if __name__ == "__main__":
    run()
