"""Licences of mesh files must be written; the dataset's follows from its parts, or must keep what they ask."""

import pytest

from dataset_builder.errors import SpecError
from dataset_builder.spec.licences import contradiction, licence_of
from dataset_builder.spec.load import load_dataset

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.mark.parametrize(("parts", "licence"), [
    ([], "CC0-1.0"), (["CC0-1.0"], "CC0-1.0"), (["CC0-1.0", "CC-BY-4.0"], "CC-BY-4.0"),
    (["CC-BY-3.0"], "CC-BY-4.0"), (["CC-BY-SA-4.0", "CC-BY-4.0"], "CC-BY-SA-4.0"),
    (["CC-BY-NC-4.0", "CC0-1.0"], "CC-BY-NC-4.0"), (["CC-BY-NC-SA-4.0", "CC-BY-NC-4.0"], "CC-BY-NC-SA-4.0"),
])
def test_the_strictest_part_decides(parts: list[str], licence: str) -> None:
    assert licence_of({f"o{k}": part for k, part in enumerate(parts)}) == (licence, "")


@pytest.mark.parametrize(("parts", "why"), [
    (["CC0-1.0", "MIT"], "the conditions of MIT (o1) are not known here"),
    (["CC-BY-ND-4.0"], "the conditions of CC-BY-ND-4.0 (o0) are not known here"),
    (["CC-BY-SA-4.0", "CC-BY-NC-4.0"], "CC-BY-SA-4.0 (o0) asks for the same licence"),
])
def test_where_none_follows(parts: list[str], why: str) -> None:
    assert licence_of({f"o{k}": part for k, part in enumerate(parts)}) == ("", why)


@pytest.mark.parametrize(("licence", "part", "why"), [
    ("CC0-1.0", "CC-BY-4.0", "attribution"), ("CC-BY-4.0", "CC-BY-NC-4.0", "no commercial use"),
    ("CC-BY-4.0", "CC-BY-SA-4.0", "the same licence"), ("MIT", "CC-BY-SA-4.0", "the same licence"),
    ("CC-BY-NC-SA-4.0", "CC-BY-SA-4.0", "the same licence"),
    ("CC-BY-4.0", "CC0-1.0", ""), ("CC-BY-NC-SA-4.0", "CC-BY-4.0", ""), ("CC0-1.0", "MIT", ""),
    ("MIT", "CC-BY-4.0", ""),
])
def test_what_a_given_licence_must_keep(licence: str, part: str, why: str) -> None:
    found = contradiction(licence, {"o": part})
    assert found == (f"{part} (o) asks for {why}" if why else "")


def with_mesh(licence: str, dataset: str = "") -> dict[str, str]:
    return {"objects/chair.yaml": f"file: a.obj\n{licence}", "objects/a.obj": TRIANGLE, "tiny.yaml": f"""\
name: tiny
{dataset}splits:
  - {{name: train, objects: {{count: 1, from: [objects/chair.yaml]}}, scenes: {{count: 1, from: [scenes/den.yaml]}}}}
"""}


def test_the_dataset_takes_the_licence_of_its_meshes(tiny) -> None:
    loaded = load_dataset(tiny(**with_mesh("licence: CC-BY-SA-4.0\n")))
    assert loaded.dataset.licence == "CC-BY-SA-4.0"
    assert {key: spec.licence for key, spec in loaded.objects.items()} == {
        "objects/chair.yaml": "CC-BY-SA-4.0", "objects/stool.yaml": "CC0-1.0"}
    assert load_dataset(tiny(**with_mesh("licence: MIT\n", "licence: Apache-2.0\n"))).dataset.licence == "Apache-2.0"


def test_embedded_furniture_is_free(tiny) -> None:
    assert load_dataset(tiny()).dataset.licence == "CC0-1.0"


@pytest.mark.parametrize(("licence", "dataset", "message"), [
    ("", "", "objects/chair.yaml:1: file: expected a `licence` beside it, the key is missing (write `licence: "
     "CC-BY-4.0`, or whatever"),
    ("licence: ''\n", "", "objects/chair.yaml:1: file: expected a `licence` beside it"),
    ("licence: MIT\n", "", "tiny.yaml:1: expected a `licence` of the dataset, since none follows from its objects: the "
     "conditions of MIT (objects/chair.yaml) are not known here (write `licence:`"),
    ("licence: CC-BY-NC-4.0\n", "licence: CC-BY-4.0\n", "tiny.yaml:2: licence: expected one that its objects allow, "
     "got CC-BY-4.0: CC-BY-NC-4.0 (objects/chair.yaml) asks for no commercial use"),
    ("licence: CC BY\n", "", "objects/chair.yaml:2: licence: expected text that matches"),
])
def test_what_is_refused(in_folder, licence: str, dataset: str, message: str) -> None:
    with pytest.raises(SpecError) as error:
        load_dataset(in_folder(**with_mesh(licence, dataset)))
    found = [str(problem) for problem in error.value.problems]
    assert len(found) == 1 and message in found[0]
