"""`python -m dataset_builder` is the command `dataset-builder`."""

import sys

from dataset_builder.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
