"""What splits share on purpose is said wherever a dataset speaks of itself; otherwise nothing is."""

import json
from pathlib import Path

import pytest
from rich.console import Console

from dataset_builder.label.shared_content import SharedContent
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.settings import DataSpec
from dataset_builder.release.training_checks import loader_checks
from dataset_builder.report.dataset_summary import summary_tables
from dataset_builder.shards.card import card
from dataset_builder.shards.croissant import croissant
from dataset_builder.shards.folder import Claim
from dataset_builder.shards.manifest import Manifest, from_json, to_json
from dataset_builder.shards.one_writer import build_lock
from dataset_builder.shards.publish import publish_dataset
from dataset_builder.shards.reader import load_manifest
from dataset_builder.shards.verify import verify
from tests.lightnet.synthetic import write_synthetic

SHARED = SharedContent(what="objects", splits=("train", "evaluation"), count=1, of=(1, 1))
SAID = "plits train and evaluation share 1 object (train has 1, evaluation 1): figures on evaluation of what"


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished dataset whose manifest says that both splits have one object."""
    folder = write_synthetic(tmp_path_factory.mktemp("shared") / "data", train=2, held_out=1, size=24)
    manifest = load_manifest(folder).model_copy(update={"in_common": (SHARED,)})
    with build_lock(folder, Claim(name=manifest.name, version=manifest.version), replace=False):
        publish_dataset(folder, manifest)
    return folder


def test_the_manifest_keeps_it_and_the_folder_is_whole(shared: Path) -> None:
    assert load_manifest(shared).in_common == (SHARED,)
    assert verify(shared) == []


def test_a_dataset_that_shares_nothing_does_not_mention_it(shared: Path) -> None:
    manifest = load_manifest(shared).model_copy(update={"in_common": ()})
    text = to_json(manifest)
    assert b"in_common" not in text and from_json(Manifest, text, where="") == manifest
    assert SAID not in card(manifest) and SAID not in croissant(manifest)


def test_card_croissant_and_summary_say_it(shared: Path) -> None:
    manifest = load_manifest(shared)
    assert f"**S{SAID}" in card(manifest)
    assert SAID in json.loads(croissant(manifest))["description"]
    console = Console(record=True, width=400)
    console.print(summary_tables(shared)[0])
    assert SAID in " ".join(console.export_text().split())


def test_trainer_and_gate_say_it(shared: Path) -> None:
    """So that it stands above the figures of `evaluate`, in the news of a training and in the gate's report."""
    for split in ("train", "evaluation"):
        assert LightingDataset(shared, split, DataSpec()).notes == (SHARED.sentence,)
    counted = loader_checks(shared, DataSpec())[0]
    assert counted.holds and counted.detail.count(SHARED.sentence) == 1
