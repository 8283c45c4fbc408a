"""The page about accuracy says what its table says, and its figures were drawn from that table."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from unittest import mock

import pytest
from PIL import Image

from dataset_builder.report.accuracy_answers import asked_sentence, trust_sentences
from dataset_builder.studies.accuracy.conclusions import Conclusions
from dataset_builder.studies.accuracy.rows import OTHERS
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


def test_asked_hours_name_what_they_may_just_miss(found: Conclusions) -> None:
    asked = replace(found.asked, hours=found.answers.uniform(found.errors).core_hours / 2)  # type: ignore[union-attr]
    bought = Conclusions.of(found.rows, found.spec, found.work, found.setup, asked)
    _, finer = bought.answers.of_hours(asked, found.setup.workers)
    said = asked_sentence(bought)
    assert finer is not None and f"i_t {finer.errors['i_t'][1]:.2g}, " in said.partition("The next errors down")[2]
    assert said.endswith("not surely within what was asked.") and "next errors" not in asked_sentence(found)


@pytest.mark.parametrize(("layer", "count", "said"), [
    ("i_t", 1, "WARNING: how examples differ is known from 1 of them: 95% are expected below these errors, and no "),
    ("i_t", 7, "and 86% surely (with a confidence of 90%, where noise is log-normal); measure more"),
    ("i_t", 8, "How examples differ is known from 8 of them: 95% are expected below these errors, and 87% surely")])
def test_what_is_sure_is_said_of_the_examples_that_there_are(found: Conclusions, layer: str, count: int,
                                                             said: str) -> None:
    dropped = [row for row in found.rows if (row.question, row.layer) == (OTHERS, layer) and row.unknown != 1][count:]
    rows = [row for row in found.rows if not any(row is other for other in dropped)]
    told = trust_sentences(Conclusions.of(rows, found.spec, found.work, found.setup, found.asked))
    assert sum(said in one for one in told) == 1


@pytest.mark.parametrize(("hours", "said"), [(None, " Goals save close to 20% of the hours, from which on they are"),
                                             (24.0, " These hours lie near a step between two answers, and either is")])
def test_where_noise_of_timings_changes_settings_the_step_is_named(found: Conclusions, hours: float | None,
                                                                   said: str) -> None:
    told = Conclusions.of(found.rows, found.spec, found.work, found.setup, replace(found.asked, hours=hours))
    for share in (0.0, 0.1):
        with mock.patch.object(Conclusions, "changed", share):
            assert any(said in one for one in trust_sentences(told)) == (share > 0)
