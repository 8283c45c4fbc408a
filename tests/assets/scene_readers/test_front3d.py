"""Scenes of 3D-FRONT: places, parts of the building, and every known fault lived with and named."""

import pytest

from dataset_builder.assets.scene_file import load_scene
from dataset_builder.assets.scene_readers.front3d_json import read_front3d
from tests.front3d_faults import FAULTS
from tests.front3d_files import house


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    folder = tmp_path_factory.mktemp("house")
    return load_scene(house().write(folder), folder, max_texture=64)


def load(folder, made):
    return load_scene(made.write(folder), folder, max_texture=64)


@pytest.mark.parametrize("name", FAULTS)
def test_faults_are_lived_with_and_named(tmp_path, clean, name):
    plant, kind, more = FAULTS[name]
    made = house()
    plant(made)
    model = load(tmp_path, made)
    assert len(model.things) == len(clean.things) + more
    assert [text for text in model.faults if kind in text]
    assert not [text for text in model.faults if str(tmp_path) in text]
