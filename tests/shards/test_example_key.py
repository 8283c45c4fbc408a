"""An example is named by its key, its index, or its place in a split."""

from pathlib import Path

import pytest

from dataset_builder.errors import UserError
from dataset_builder.shards.example_key import key_of
from dataset_builder.shards.reader import Dataset, open_dataset


@pytest.fixture(scope="module")
def dataset(small_dataset: Path) -> Dataset:
    return open_dataset(small_dataset, layers=())


@pytest.mark.parametrize(("text", "index"), [("00000003", 3), ("3", 3), ("003", 3), ("train:0", 0), ("train:7", 7),
                                             ("test:0", 8), ("test:1", 9)])
def test_names_of_an_example(dataset: Dataset, text: str, index: int) -> None:
    assert key_of(dataset, text) == f"{index:08d}"


@pytest.mark.parametrize(("text", "said"), [
    ("10", "expected the key of an example, such as 00000012, 12 or train:0, got '10'"),
    ("../3", "got '../3'"), ("-1", "got '-1'"), ("", "got ''"), ("tain:0", "got 'tain:0'"),
    ("train:8", "expected train:0 to train:7, got 'train:8'"), ("test:-1", "expected test:0 to test:1"),
    ("٣", "got '٣'"), ("²", "got '²'"),
])
def test_what_is_no_name_is_refused(dataset: Dataset, text: str, said: str) -> None:
    with pytest.raises(UserError) as refused:
        key_of(dataset, text)
    assert said in str(refused.value)
