"""The meshes of a view are those that were rendered, and the distances that are shown those of the labels."""

from pathlib import Path

import numpy as np
import pytest

from dataset_builder.errors import UserError
from dataset_builder.rendering.scene.triangle_soup import clean, rough_twin
from dataset_builder.report.looking.level_meshes import LevelMesh, ViewMeshes, level_keys, view_meshes
from dataset_builder.shards.reader import open_dataset


@pytest.fixture(scope="module")
def meshes(small_dataset: Path, small_spec: Path) -> ViewMeshes:
    """Those of the first view under its second light."""
    return view_meshes(small_dataset, "3", small_spec.parent, None)


def test_all_levels_of_the_same_view_and_light(meshes: ViewMeshes, small_dataset: Path) -> None:
    assert [level.label.key for level in meshes.levels] == ["00000002", "00000003"]
    assert [level.label.plan.rough.level for level in meshes.levels] == [0, 1] and meshes.missing == ()
    assert meshes.own.key == "00000003" and meshes.own.plan.light == 1
    dataset = open_dataset(small_dataset, layers=())
    assert level_keys(small_dataset, dataset.label("00000009")) == ["00000008", "00000009"]


def test_they_are_what_was_rendered(meshes: ViewMeshes, small_spec: Path) -> None:
    target = meshes.own.plan.target
    assert meshes.clean is not None
    np.testing.assert_array_equal(meshes.clean.corners, clean(target, small_spec.parent).corners)
    for level in meshes.levels:
        rough = rough_twin(target, level.label.plan.rough, small_spec.parent)
        np.testing.assert_array_equal(level.rough.corners, rough.soup.corners)


def of_vertices(level: LevelMesh) -> np.ndarray:
    """Distances of a level's vertices, each once, in radii."""
    assert level.distance is not None
    _, first = np.unique(level.rough.corners.reshape(-1, 3), axis=0, return_index=True)
    return level.distance.ravel()[first]


def test_distances_are_those_of_the_label(meshes: ViewMeshes) -> None:
    level = meshes.levels[1]
    record, found = level.label.record, of_vertices(level)
    assert found.max() == pytest.approx(record.roughness_max, abs=1e-9) and record.roughness_max > 0.01
    assert np.sqrt(np.mean(found**2)) == pytest.approx(record.roughness_rms, rel=1e-6)
    assert (level.rms, level.maximum) == pytest.approx((record.roughness_rms, record.roughness_max), rel=1e-6)
    assert meshes.radius == record.bounding_radius and not level.differs


def test_without_noise_nothing_is_apart(meshes: ViewMeshes) -> None:
    found, record = of_vertices(meshes.levels[0]), meshes.levels[0].label.record
    assert found.max() == pytest.approx(record.roughness_max, abs=1e-9) and found.max() < 1e-4


def test_another_mesh_than_the_rendered_one_is_told(meshes: ViewMeshes) -> None:
    level = meshes.levels[1]
    record = level.label.record.model_copy(update={"roughness_rms": level.rms * 1.1})
    other = LevelMesh(label=level.label.model_copy(update={"record": record}), rough=level.rough, rms=level.rms,
                      distance=level.distance, maximum=level.maximum)
    assert other.differs


def test_a_missing_example_or_file_is_named(small_dataset: Path, small_spec: Path, monkeypatch) -> None:
    with pytest.raises(UserError, match="expected the key of an example"):
        view_meshes(small_dataset, "77", small_spec.parent, None)
    module = "dataset_builder.report.looking.level_meshes.sources"
    monkeypatch.setattr(module, lambda *placed: ["chairs/oak.glb"])
    with pytest.raises(UserError, match=r"chairs/oak.glb: expected a file .* found none \(give the folder .* --meshes"):
        view_meshes(small_dataset, "0", small_spec.parent, None)
