from collections import Counter
from time import process_time
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from dataset_builder.planning.catalogue import count_examples, examples, pairs_of, units, views_of
from dataset_builder.spec.dataset import DatasetSpec, SplitSpec


def split_of(objects: int, scenes: int, pairs: int | str) -> SplitSpec:
    return SplitSpec.model_validate({"name": "train", "objects": {"from": ["o"], "count": objects},
                                     "scenes": {"from": ["s"], "count": scenes}, "pairs": pairs})


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 12), st.integers(1, 12), st.data())
def test_pairs_are_distinct_and_use_objects_and_scenes_evenly(objects: int, scenes: int, data: st.DataObject) -> None:
    wanted = data.draw(st.integers(1, objects * scenes))
    pairs = pairs_of(split_of(objects, scenes, wanted))
    assert len(set(pairs)) == wanted
    for members, count in (([p.object for p in pairs], objects), ([p.scene for p in pairs], scenes)):
        used = Counter(members)
        assert max(used.values()) - min(used[k] for k in range(count)) <= 1
    assert pairs == pairs_of(split_of(objects, scenes, "all"))[:wanted]


def test_examples_of_a_view_are_neighbours_and_indices_count_over_all_splits(dataset_data: dict[str, Any]) -> None:
    spec = DatasetSpec.model_validate(dataset_data)
    refs = examples(spec)
    assert len(refs) == count_examples(spec) == 6 * 2 * 2 * 2 + 2 * 1 * 1 * 2
    assert [ref.index for ref in refs] == list(range(len(refs)))
    assert len({ref.key for ref in refs}) == len(refs) and all(len(ref.key) == 8 for ref in refs)
    grouped = units(reversed(refs))
    assert [len(unit.examples) for unit in grouped] == [4] * 12 + [2] * 2
    assert len({unit.view for unit in grouped}) == len(grouped)
    assert grouped[0].lights == (0, 1) and grouped[0].levels == (0, 1)


def test_views_are_shuffled_and_numbered_in_that_order(dataset_data: dict[str, Any]) -> None:
    spec = DatasetSpec.model_validate(dataset_data)
    views = views_of(spec, spec.splits[0])
    unshuffled = [(pair, camera) for pair in pairs_of(spec.splits[0]) for camera in range(2)]
    assert [(view.pair, view.camera) for view in views] != unshuffled
    assert {(view.pair, view.camera) for view in views} == set(unshuffled)
    assert [view.name for view in views] == [f"train/{number:06d}" for number in range(12)]


def test_more_lights_levels_or_splits_do_not_reorder_views(dataset_data: dict[str, Any]) -> None:
    before = DatasetSpec.model_validate(dataset_data)
    dataset_data["rough"] = {"sigma": [0.0, 0.1, 0.2]}
    dataset_data["splits"][0]["lights"] = 5
    dataset_data["splits"].append({**dataset_data["splits"][1], "name": "more"})
    after = DatasetSpec.model_validate(dataset_data)
    for a, b in zip(before.splits, after.splits, strict=False):
        assert views_of(before, a) == views_of(after, b)


def test_twelve_thousand_examples_take_less_than_half_a_second(dataset_data: dict[str, Any]) -> None:
    dataset_data["splits"][0] |= {"objects": {"from": ["o"], "count": 30}, "scenes": {"from": ["s"], "count": 50},
                                  "views": 4, "lights": 1}
    spec = DatasetSpec.model_validate(dataset_data)
    start = process_time()
    assert len(examples(spec)) > 12_000
    assert process_time() - start < 0.5
