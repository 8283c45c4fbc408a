"""The page about accuracy says what its table says, and its figures were drawn from that table."""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from PIL import Image

from dataset_builder.studies.accuracy.conclusions import Conclusions
from tools import accuracy_docs

PAGE = accuracy_docs.PAGE.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def found() -> Conclusions:
    """What the kept rows say."""
    return accuracy_docs.conclusions()


def test_the_page_is_what_its_table_says(found: Conclusions) -> None:
    assert accuracy_docs.made(PAGE, found) == PAGE
    marks = [match[2] for match in accuracy_docs.MARK.finditer(PAGE)]
    assert sorted(marks) == sorted(accuracy_docs.all_parts(found))


def test_a_figure_that_was_changed_by_hand_is_found(found: Conclusions) -> None:
    changed = PAGE.replace(" GB.", "0 GB.", 1)
    assert changed != PAGE and accuracy_docs.made(changed, found) == PAGE


def test_figures_are_of_this_table_and_all_are_shown() -> None:
    shown = set(re.findall(r"\(images/accuracy/([\w-]+)\.png\)", PAGE))
    files = {path.stem: path for path in accuracy_docs.KEPT.glob("*.png")}
    assert shown == set(files) == set(accuracy_docs.SHOWN)
    assert set(_stamps(files.values())) == {accuracy_docs.digest_of_table()}


def _stamps(files: Iterable[Path]) -> Iterator[str]:
    for path in files:
        with Image.open(path) as picture:
            yield str(picture.info[accuracy_docs.STAMP])


def test_the_advice_does_not_follow_the_noise_of_timings(found: Conclusions) -> None:
    assert found.changed == 0
