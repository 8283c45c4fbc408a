import io
import json
import re
import shutil
import subprocess
import tarfile
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from dataset_builder.digest import digest
from dataset_builder.errors import ShardError
from dataset_builder.shards import exr
from dataset_builder.shards.card import card
from dataset_builder.shards.croissant import croissant
from dataset_builder.shards.manifest import Manifest, Rejected, make_manifest
from dataset_builder.shards.publish import publish_dataset
from dataset_builder.shards.reader import load_manifest
from tests.plans import PAPER
from tests.shards.tiny_dataset import default_examples, make_spec, shard_path


def rejecting(manifest: Manifest) -> Manifest:
    item = Rejected(key="00000007", view="train/000007", gate="coverage", reason="expected more | got less")
    return manifest.model_copy(update={"rejected": (item,)})


@pytest.mark.skipif(shutil.which("sha256sum") is None, reason="needs coreutils")
def test_the_sums_satisfy_sha256sum(dataset: Path) -> None:
    check = subprocess.run(["sha256sum", "-c", "--strict", "SHA256SUMS"], cwd=dataset, capture_output=True, text=True)
    assert check.returncode == 0 and check.stdout.count(": OK") == 9
    (dataset / "croissant.json").write_text("{}")
    check = subprocess.run(["sha256sum", "-c", "SHA256SUMS"], cwd=dataset, capture_output=True, text=True)
    assert check.returncode == 1 and "croissant.json: FAILED" in check.stdout


def test_shards_follow_webdatasets_rule(dataset: Path) -> None:
    for shard in load_manifest(dataset).shards:
        groups: dict[str, list[str]] = {}
        with tarfile.open(dataset / "shards" / shard.name) as tar:
            for info in tar:
                key, _, suffix = info.name.partition(".")
                assert not groups or key in (last := list(groups)[-1],) or key not in groups, f"{key} after {last}"
                groups.setdefault(key, []).append(suffix)
        assert len(groups) == shard.examples and list(groups) == sorted(groups)
        assert len({tuple(suffixes) for suffixes in groups.values()}) == 1
        assert all(len(set(suffixes)) == len(suffixes) for suffixes in groups.values())


def test_the_standard_library_finds_the_pixels(dataset: Path) -> None:
    with tarfile.open(shard_path(dataset, "tiny-v1-test-000000")) as tar:
        stream = tar.extractfile("00000003.i_t.exr")
        assert stream is not None
        assert np.array_equal(exr.decode(io.BytesIO(stream.read()).read()), default_examples()[3].layers["i_t"])


def test_the_card_has_configs_for_every_split_and_names_what_is_left_out(dataset: Path) -> None:
    manifest = load_manifest(dataset)
    head = YAML(typ="safe").load(card(manifest).split("---\n")[1])
    assert head["configs"][0]["data_files"] == [{"split": "train", "path": "shards/tiny-v1-train-*.tar"},
                                                {"split": "test", "path": "shards/tiny-v1-test-*.tar"}]
    assert (head["license"], head["size_categories"], head["pretty_name"]) == ("cc0-1.0", ["n<1K"], "Tiny")
    assert "| 00000007 | coverage | expected more \\| got less |" in card(rejecting(manifest))


def test_the_card_finds_the_shards_of_a_split_whose_first_was_rejected_whole(dataset: Path) -> None:
    manifest = load_manifest(dataset)
    train, test = manifest.splits
    late = train.model_copy(update={"shards": ("tiny-v1-train-000001-0123abcd.tar",)})
    none = test.model_copy(update={"shards": ()})
    head = YAML(typ="safe").load(card(manifest.model_copy(update={"splits": (late, none)})).split("---\n")[1])
    assert head["configs"][0]["data_files"] == [{"split": "train", "path": "shards/tiny-v1-train-*.tar"}]


def test_the_card_claims_no_rendering_of_what_could_not_be_planned(dataset: Path) -> None:
    text = card(rejecting(load_manifest(dataset)))
    assert "planned and rendered" not in text and "gate is `planning`" in text
    assert [line for line in text.splitlines() if line.startswith("## ")] == [
        "## Motivation", "## Composition", "## Generation", "## Excluded examples", "## Known artefacts", "## Reading",
        "## Maintenance"]


def test_no_dataset_without_its_shards(dataset: Path) -> None:
    manifest = load_manifest(dataset)
    with shard_path(dataset, "tiny-v1-test-000000").open("ab") as stream:
        stream.write(b"!")
    with pytest.raises(ShardError, match=r"tiny-v1-test-000000-[0-9a-f]{8}\.tar: expected a finished shard"):
        publish_dataset(dataset, manifest)


def test_the_layer_table_says_what_layers_say() -> None:
    manifest = make_manifest(make_spec("float16"), layers=dict(PAPER), shards=[],  # type: ignore[arg-type]
                             rejected=(), spec_digest=digest(""), generator="g")
    rows = {row.name: row for row in manifest.layers}
    assert (rows["mask"].colour_space, rows["mask"].channels, rows["mask"].range) == ("data", 1, "[0, 1]")
    assert (rows["i_s"].extent, rows["i_s"].range, rows["i_s"].dtype) == ("frame", "[0, inf)", "float16")
    assert {row.name: row.tolerance for row in manifest.identities}["reflectance"] == 2e-3


@pytest.mark.parametrize("text", [
    'a "quoted" one', "a: b", "--- x", "`code` | cell", "<script>alert(1)</script>", "# head", "[/] [x](y)", "- item",
    "1. item", "\\ back", "yes", "*a* _b_", "~~~", "two\nlines\n---\nlicense: mit\n", "ünï 😀", "{a: &b *c}"])
def test_the_card_shows_text_as_it_is(dataset: Path, text: str) -> None:
    manifest = load_manifest(dataset).model_copy(update={"title": text, "licence": text, "description": text})
    lines = card(manifest).split("\n")
    end = lines.index("---", 1)
    head = YAML(typ="safe").load("\n".join(lines[1:end]))
    assert (head["pretty_name"], head["license"]) == (text, text.lower())
    assert [line for line in lines if line.startswith("## ")] == [
        line for line in card(load_manifest(dataset)).split("\n") if line.startswith("## ")]
    title, description = lines[end + 2], lines[end + 4]
    assert title.startswith("# ") and "<s" not in title.replace("\\<s", "")
    for shown in (title.removeprefix("# ").removesuffix(" 1.0.0"), description):
        assert re.sub(r"\\([^a-zA-Z0-9 ])", r"\1", shown).replace("\\1.", "1.") == " ".join(text.split())
    assert not re.match(r"[-#+=:>`~]", description)
    document = json.loads(croissant(manifest))
    assert re.fullmatch(r"https://spdx\.org/licenses/[^\s<>\"]+\.html", document["license"])
    assert document["description"] == text
