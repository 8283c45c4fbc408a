"""croissant.json: what its specification asks for, and what it says of splits, labels, pixels and licences."""

import json
import re
import tarfile
from pathlib import Path
from typing import Any

import pytest

from dataset_builder.digest import sha256_file
from dataset_builder.label.scene_plan import ObjectSource
from dataset_builder.shards.card import card
from dataset_builder.shards.croissant import croissant
from dataset_builder.shards.reader import load_manifest
from dataset_builder.shards.verify import verify
from tests.plans import PAPER

NAMES = [name for name, _ in PAPER]
PYTHON = {"sc:Text": str, "sc:Integer": int, "sc:Float": float, "sc:Boolean": bool}


def record_sets(folder: Path) -> dict[str, dict[str, Any]]:
    document = json.loads((folder / "croissant.json").read_text())
    return {records["@id"]: records for records in document["recordSet"]}


def test_croissant_has_what_its_specification_requires(dataset: Path) -> None:
    document = json.loads(croissant(load_manifest(dataset)))
    required = {"@context", "@type", "name", "description", "license", "url", "creator", "datePublished", "version",
                "dct:conformsTo", "citeAs", "distribution", "recordSet"}
    assert required <= set(document) and document["dct:conformsTo"].endswith("/1.1")
    objects = {item["@id"]: item for item in document["distribution"] if item["@type"] == "cr:FileObject"}
    sets = {item["@id"]: item for item in document["distribution"] if item["@type"] == "cr:FileSet"}
    for item in objects.values():
        assert item["sha256"] == sha256_file(dataset / item["contentUrl"])
        assert item["contentSize"] == f"{(dataset / item['contentUrl']).stat().st_size} B"
    included = {item["includes"] for item in sets.values()}
    assert included == {"*.json", *(f"*.{name}.exr" for name in NAMES)} and len(sets) == len(included)
    assert all({source["@id"] for source in item["containedIn"]} == set(objects) for item in sets.values())


def test_every_id_that_croissant_refers_to_exists(dataset: Path) -> None:
    document = json.loads(croissant(load_manifest(dataset)))
    declared, used = set(), set()

    def walk(value: object) -> None:
        for item in value if isinstance(value, list) else value.values() if isinstance(value, dict) else ():
            walk(item)
        if isinstance(value, dict) and "@id" in value:
            (declared if "@type" in value else used).add(value["@id"])

    walk([document["distribution"], document["recordSet"]])
    assert used and used <= declared
    pattern = document["recordSet"][2]["field"][0]["source"]["transform"]["regex"]
    match = re.search(pattern, "00000042.i_s.exr")
    assert match is not None and match[1] == "00000042"
    assert [records["@id"] for records in document["recordSet"]] == ["splits", "label", *NAMES]


def at(label: Any, path: str) -> Any:
    """What a JSON path of plain keys leads to."""
    assert path.startswith("$.")
    for key in path[2:].split("."):
        label = label[key]
    return label


def test_labels_have_the_fields_and_types_that_are_claimed(small_dataset: Path) -> None:
    """Every field of every label of a rendered dataset; text, numbers and vectors are all there."""
    fields = record_sets(small_dataset)["label"]["field"]
    shards = load_manifest(small_dataset).shards
    for shard in shards:
        with tarfile.open(small_dataset / "shards" / shard.name) as tar:
            labels = [json.loads(tar.extractfile(info).read()) for info in tar if info.name.endswith(".json")]  # type: ignore[union-attr]
        for label in labels:
            for field in fields:
                value, kind = at(label, field["source"]["extract"]["jsonPath"]), PYTHON[field["dataType"]]
                assert field["@id"] == "label/" + field["source"]["extract"]["jsonPath"][2:].replace(".", "/")
                if not field.get("isArray"):
                    assert type(value) is kind, field["@id"]
                else:
                    rows = value if field["arrayShape"] == "-1,3" else [value]
                    assert rows and all(len(row) == 3 and {type(one) for one in row} == {kind} for row in rows)
    names = {field["name"] for field in fields}
    assert {"key", "split", "plan/camera/position", "plan/target/object/category", "plan/rough/sigma",
            "record/lighting_sh", "layers/i_t/mean"} <= names and len(names) == len(fields) > 60


def test_splits_are_a_record_set(dataset: Path) -> None:
    found = record_sets(dataset)
    assert found["splits"]["dataType"] == "cr:Split"
    assert found["splits"]["data"] == [{"splits/name": "train", "splits/examples": 3},
                                       {"splits/name": "test", "splits/examples": 1}]
    split, = (field for field in found["label"]["field"] if field["name"] == "split")
    assert split["references"] == {"field": {"@id": "splits/name"}}


def test_pixels_are_images(dataset: Path) -> None:
    found = record_sets(dataset)
    types = {name: {field["name"]: field["dataType"] for field in found[name]["field"]} for name in NAMES}
    assert types == {name: {"key": "sc:Text", "content": "sc:ImageObject"} for name in NAMES}
    sets = {item["@id"]: item["encodingFormat"] for item in json.loads((dataset / "croissant.json").read_text())[
        "distribution"] if item["@type"] == "cr:FileSet"}
    assert sets == {"label-files": "application/json", **{f"{name}-files": "image/x-exr" for name in NAMES}}


@pytest.mark.parametrize(("change", "where"), [
    (lambda doc: doc["recordSet"][0]["data"].pop(), "recordSet"), (lambda doc: doc["recordSet"].pop(0), "recordSet"),
    (lambda doc: doc["recordSet"][0]["data"][0].update({"splits/examples": 4}), "recordSet"),
    (lambda doc: doc["distribution"].pop(0), "distribution"), (lambda doc: doc.update(recordSet=[7]), "")])
def test_verify_compares_it_with_the_manifest(dataset: Path, change: Any, where: str) -> None:
    path = dataset / "croissant.json"
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    assert [problem.path for problem in verify(dataset) if problem.where == "croissant.json"
            and "SHA-256 of" not in problem.rule.replace("the shards and SHA-256 of", "")
            and "(SHA256SUMS)" not in problem.rule] == [where]


def test_card_and_croissant_name_the_same_licences(dataset: Path) -> None:
    parts = (ObjectSource(kind="file", source="meshes/pot.glb", licence="CC-BY-NC-4.0", objects=("train-pot-00",)),
             ObjectSource(kind="procedural", source="chair", licence="CC0-1.0",
                          objects=tuple(f"train-chair-{k:02d}" for k in range(9))))
    manifest = load_manifest(dataset).model_copy(update={"parts": parts, "licence": "CC-BY-NC-4.0"})
    document, text = json.loads(croissant(manifest)), card(manifest)
    pages = [f"https://spdx.org/licenses/{name}.html" for name in ("CC-BY-NC-4.0", "CC0-1.0")]
    assert document["license"] == pages[0]
    assert [(part["name"], part["license"]) for part in document["isBasedOn"]] == [
        ("meshes/pot.glb", pages[0]), ("chair", pages[1])]
    assert "license: \"cc-by-nc-4.0\"" in text and "Licence: CC-BY-NC-4.0" in text
    assert "| meshes/pot.glb | mesh file | CC-BY-NC-4.0 | train-pot-00 |" in text
    assert "| chair | embedded | CC0-1.0 | train-chair-00, train-chair-01, train-chair-02 and 6 more |" in text


def test_a_licence_of_ones_own_has_no_page(dataset: Path) -> None:
    manifest = load_manifest(dataset).model_copy(update={"licence": "LicenseRef-mine"})
    assert json.loads(croissant(manifest))["license"] == "LicenseRef-mine"
    assert 'license: other\nlicense_name: "licenseref-mine"\n' in card(manifest)


@pytest.mark.filterwarnings("ignore")
def test_mlcroissant_finds_nothing_wrong(small_dataset: Path) -> None:
    """It does not read JSON inside archives, and no EXR: their records are for readers that do."""
    mlcroissant = pytest.importorskip("mlcroissant", reason="needs mlcroissant, which brings pandas (95 MB)")
    found = mlcroissant.Dataset(jsonld=str(small_dataset / "croissant.json"))
    assert not found.metadata.issues.errors and not found.metadata.issues.warnings
    assert [record["splits/name"] for record in found.records("splits")] == ["train", "test"]
    assert {records.id for records in found.metadata.record_sets} == set(record_sets(small_dataset))
