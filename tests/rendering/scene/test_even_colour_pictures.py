"""Pictures of things of one colour each: the same whether vertices or a material have it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.assets import mesh_file
from dataset_builder.planning.plan import plan_example
from dataset_builder.rendering.examples import render_view
from dataset_builder.spec.load import load_dataset
from tests.gltf_scenes import CHAIR, DATASET, FACES, ROOM, SPEC, thing


def write_stage(folder: Path) -> Path:
    """A dataset whose scene is an .obj file of things of one colour each, one of them half there."""
    things = [*ROOM, CHAIR, thing("Screen", np.diag([0.5, 0.02, 0.8, 1]) + 0.3 * np.eye(4, k=3)[0], (0.1, 0.3, 0.9))]
    lines, first = [], 1
    for each in things:
        lines.append(f"o {each['name']}")
        placed = each["positions"] @ each["world"][:3, :3].T + each["world"][:3, 3]
        color = [*each["color"], *([0.5] if each["name"] == "Screen" else [1])]
        lines += [" ".join(map(str, ["v", x, z, -y, *color])) for x, y, z in placed.tolist()]
        lines += [" ".join(["f", *map(str, face)]) for face in (FACES + first).tolist()]
        first += len(placed)
    folder.mkdir()
    (folder / "stage.obj").write_text("\n".join(lines))
    (folder / "scene.yaml").write_text(SPEC.replace("stage.gltf", "stage.obj"))
    dataset = DATASET.replace('{name: "*"}, count: 2', '{name: "Chair*"}, count: 1')
    (folder / "dataset.yaml").write_text(dataset)
    return folder / "dataset.yaml"


def rendered(folder: Path) -> tuple[tuple[str, ...], dict[str, Any]]:
    """Features and layers of the example."""
    plan = plan_example(load_dataset(write_stage(folder)), 0)
    return plan.effects.features, dict(next(iter(render_view([plan], folder))).layers)


def test_pictures_stay_as_they_are_without_colours_of_vertices(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    features, layers = rendered(tmp_path / "now")
    monkeypatch.setattr(mesh_file, "with_even_colours", lambda model: model)
    before, expected = rendered(tmp_path / "before")
    assert set(before) - set(features) == {"colours"} and not set(features) - set(before)
    assert "coverage" in features and layers.keys() == expected.keys()
    for name, layer in layers.items():
        assert np.allclose(layer, expected[name], rtol=1e-3, atol=1e-5), name
