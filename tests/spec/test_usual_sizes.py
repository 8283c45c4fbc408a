import doctest

import pytest

from dataset_builder.spec import usual_sizes
from dataset_builder.spec.families import FAMILIES
from dataset_builder.spec.usual_sizes import USUAL, category_of, size_advice, usual_of


def advice(largest, category="", suffix=".obj", scale=1.0, up="y"):
    return size_advice((largest, largest / 2, largest / 2), category=category, suffix=suffix, scale=scale, up=up)


def test_examples_of_the_docstrings():
    assert doctest.testmod(usual_sizes).failed == 0


@pytest.mark.parametrize(("largest", "category", "scale", "unit", "refused"), [
    (80, "chair", 0.01, "centimetres", True), (800, "chair", 0.001, "millimetres", True),
    (35, "chair", 0.0254, "inches", True), (2.8, "dining chair", 0.3048, "feet", False),
    (0.0008, "chair", 1000, "kilometres", True), (60, "thing", 0.01, "centimetres", False),
    (600, "thing", 0.001, "millimetres", True), (0.0003, "thing", 1000, "kilometres", True),
])
def test_scales_by_the_unit_of_the_file(largest, category, scale, unit, refused):
    found = advice(largest, category)
    assert (found.scale, found.refused) == (scale, refused)
    assert f"write `scale: {scale:g}`" in found.hint and f"probably in {unit}" in found.hint


@pytest.mark.parametrize("category", [*(usual.name for usual in USUAL), "thing"])
@pytest.mark.parametrize("exponent", range(-5, 6))
def test_a_proposed_scale_is_always_right(category, exponent):
    """Whatever is proposed has nothing said against it when it is written."""
    largest = 3.7 * 10.0 ** exponent
    if found := advice(largest, category, scale=0.5):
        assert advice(largest / 0.5 * found.scale, category, scale=found.scale) is None


def test_a_scale_too_much_is_taken_back():
    found = advice(0.008, "chair", scale=0.01)
    assert found.scale == 1 and "probably in" not in found.hint


def test_formats_with_a_unit_are_named():
    assert "glTF is in metres" in advice(80, "chair", ".glb").hint
    assert "USD names" in advice(80, "chair", ".USDC").hint and "definition" not in advice(80, "chair").hint


@pytest.mark.parametrize(("largest", "category", "said", "refused"), [
    (20, "", False, False), (0.02, "", False, False), (20.1, "", True, False), (0.0199, "", True, False),
    (200, "", True, False), (201, "", True, True), (0.0019, "", True, True),
    (15, "chair", True, False), (15.1, "chair", True, True), (1.5, "chair", False, False),
])
def test_where_a_size_is_unusual_and_where_it_is_refused(largest, category, said, refused):
    found = advice(largest, category)
    assert (found is not None) == said and (found is not None and found.refused) == refused


@pytest.mark.parametrize(("size", "category", "up", "proposed"), [
    ((2.0, 1.0, 1.6), "bed", "y", "z"), ((2.0, 1.6, 1.0), "bed", "y", ""), ((2.0, 1.0, 1.6), "bed", "z", "y"),
    ((2.0, 1.0, 1.6), "bunk bed", "y", ""), ((2.0, 0.01, 1.5), "rug", "y", "z"),
    ((1.2, 2.0, 0.6), "wardrobe", "y", "z"), ((1.2, 0.6, 2.0), "wardrobe", "y", ""),
    ((2.0, 1.0, 1.6), "bed", "x", ""), ((0.5, 0.5, 1.1), "table", "y", ""),
])
def test_another_axis_is_proposed_with_care(size, category, up, proposed):
    found = size_advice(size, category=category, suffix=".obj", scale=1.0, up=up)
    assert (found.up if found else "") == proposed
    assert not found or ("perhaps" in found.hint and not found.refused)


def test_the_categories_of_embedded_furniture_are_known():
    assert [family.category for family in FAMILIES.values() if not usual_of(family.category)] == []


@pytest.mark.parametrize(("names", "category"), [
    (("raw_model", "aws_ChairA_01"), "chair"), (("painted_wooden_cabinet_02",), "cabinet"),
    (("tea_set_01",), "tea set"), (("Sofas",), "sofa"),
    (("couch7",), "sofa"), (("model", "x17"), "object"), (("vegetable",), "object"),
    (("chair_cushion",), "cushion"), (("TVStand",), "cabinet"), (("wooden bookshelf worn",), "bookshelf"),
])
def test_categories_from_names(names, category):
    assert category_of(names) == category


def test_what_is_meant_to_be_small_can_say_so():
    found = advice(0.01, "chair")
    assert found.refused and "`category: miniature chair`" in found.hint and not advice(0.01, "miniature chair")
    assert "miniature" not in advice(80, "chair").hint


def test_no_word_means_two_things():
    words = [word for usual in USUAL for word in (usual.name, *usual.words)]
    assert len(words) == len(set(words))
