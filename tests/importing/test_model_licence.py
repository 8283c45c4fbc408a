import doctest
import json
from pathlib import Path

import pytest

from dataset_builder.importing import model_licence as module
from dataset_builder.importing.find_models import FoundModel
from dataset_builder.importing.model_licence import FoundLicence, licence_of_model, licences_in


@pytest.fixture
def model(tmp_path: Path) -> FoundModel:
    path = tmp_path / "models" / "oak-chair" / "raw_model.gltf"
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps({"asset": {"version": "2.0"}}))
    return FoundModel(path=path, root=tmp_path / "models")


def test_examples_of_the_docstrings() -> None:
    assert doctest.testmod(module).failed == 0


@pytest.mark.parametrize(("text", "found"), [
    ("SPDX-License-Identifier: LicenseRef-mine\nlike MIT", ["LicenseRef-mine"]),
    ("Creative Commons Attribution 4.0 International Public License", ["CC-BY-4.0"]),
    ("Attribution-NonCommercial-ShareAlike 4.0 International", ["CC-BY-NC-SA-4.0"]),
    ("CC-BY-4.0 (http://creativecommons.org/licenses/by/4.0/)", ["CC-BY-4.0"]),
    ("https://creativecommons.org/publicdomain/zero/1.0/", ["CC0-1.0"]), ("CC BY-ND 3.0", ["CC-BY-ND-3.0"]),
    ("MIT No Attribution", ["MIT-0"]), ("MIT License", ["MIT"]), ("Apache License\n   Version 2.0", ["Apache-2.0"]),
    ("CC BY", []), ("all rights reserved", []), ("submit", []), ("MIT or Apache-2.0", ["MIT", "Apache-2.0"]),
])
def test_licences_by_their_texts(text: str, found: list[str]) -> None:
    assert licences_in(text) == found


@pytest.mark.parametrize(("name", "text", "source"), [
    ("oak-chair/raw_model.license.json", '{"license": "CC-BY-4.0"}', "raw_model.license.json"),
    ("oak-chair/LICENSE", "CC-BY-4.0", "LICENSE"), ("LICENCE.txt", "CC BY 4.0", "LICENCE.txt"),
    ("README.md", "# Chairs\n\nLicense: CC-BY-4.0\n", "README.md"),
    ("model_info.json", '[{"model_id": "x"}, {"model_id": "oak-chair", "licence": "CC-BY-4.0"}]', "model_info.json"),
    ("oak-chair/raw_model.gltf",
     '{"asset": {"version": "2.0", "extras": {"license": "CC-BY-4.0 (http://cc)"}}}', "raw_model.gltf"),
    ("oak-chair/raw_model.gltf",
     '{"asset": {"version": "2.0", "copyright": "2020 A. Maker, CC BY 4.0"}}', "raw_model.gltf"),
])
def test_where_a_licence_is_looked_for(model: FoundModel, name: str, text: str, source: str) -> None:
    (model.root / name).write_text(text)
    assert licence_of_model(model) == FoundLicence(spdx="CC-BY-4.0", source=source)


@pytest.mark.parametrize(("name", "text"), [
    ("README.md", "Like MIT's chairs"), ("LICENSE", "Ask me."), ("LICENSE", ""), ("../LICENSE", "CC0"),
    ("oak-chair/raw_model.license.json", "[" * 100_000), ("oak-chair/raw_model.license.json", '{"license": 4}'),
    ("model_info.json", '[{"model_id": "elm-chair", "licence": "CC-BY-4.0"}, 3]'), ("LICENSE.png", "CC0"),
    ("oak-chair/raw_model.gltf", '{"asset": [], "licence": "CC0"}'),
])
def test_no_licence_is_ever_made_up(model: FoundModel, name: str, text: str) -> None:
    (model.root / name).write_text(text)
    assert licence_of_model(model) == FoundLicence()


def test_the_nearest_source_counts(model: FoundModel) -> None:
    (model.root / "LICENSE").write_text("CC0-1.0")
    (model.path.parent / "LICENSE").write_text("MIT-0")
    assert licence_of_model(model).spdx == "MIT-0"


def test_of_several_licences_the_models_own_line_counts(model: FoundModel) -> None:
    table = "| folder | licence |\n| oak-chair | CC0 1.0 |\n| elm-chair | MIT-0 |\n"
    (model.root / "LICENSES.md").write_text(table)
    assert licence_of_model(model) == FoundLicence(spdx="CC0-1.0", source="LICENSES.md")
    (model.root / "LICENSES.md").write_text(table.replace("oak-chair", "oak-chair-2"))
    assert licence_of_model(model) == FoundLicence(source="LICENSES.md names several: CC0-1.0, MIT-0")


@pytest.mark.parametrize(("line", "found"), [
    ("- oak-chair.glb by A. Maker: CC0", "CC0-1.0"), ("`models/oak-chair/raw_model.gltf`\tCC0-1.0", "CC0-1.0"),
    ("| elm, oak-chair | CC0 |", "CC0-1.0"), ("the oak-chair and its like are CC0", ""), ("a chair, CC0", ""),
])
def test_a_line_is_about_what_it_lists(model: FoundModel, line: str, found: str) -> None:
    """A folder called `a` is no reason to take a sentence that has the word."""
    below = model.path.parent / "a" / model.path.name
    below.parent.mkdir()
    below.write_bytes(model.path.read_bytes())
    (model.root / "LICENSES.md").write_text(f"{line}\nelm-chair: MIT-0\n")
    assert licence_of_model(FoundModel(path=below, root=model.root)).spdx == found
