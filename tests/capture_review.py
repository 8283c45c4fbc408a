"""Reviews of captures, for the tests of what is told of them."""

from pathlib import Path

import pytest

from dataset_builder.errors import UserError
from dataset_builder.importing.captures.find_capture import read_capture
from dataset_builder.importing.captures.review import Reviewed, reviewed
from tests.capture_files import Made, tilted

MADE = Made(turn=tilted(), scale=3.0)


def review(folder: Path, work: Path, **options: object) -> Reviewed:
    return reviewed(read_capture(folder), folder.name, **{  # type: ignore[arg-type]
        "size": 64, "ball": None, "skip": False, "work": work, **options})


def refused(folder: Path, work: Path, **options: object) -> str:
    with pytest.raises(UserError) as caught:
        review(folder, work, **options)
    return str(caught.value)
