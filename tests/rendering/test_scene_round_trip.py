"""A procedural room, written as glTF and read back, gives the same pictures, by the same kernel."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
import pytest
from scipy import stats

from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.scene_plan import RoomPlan
from dataset_builder.label.scene_source import PartPatterns, SceneFilePlan, SceneSource, SceneThingPlan
from dataset_builder.planning.plan import plan_example
from dataset_builder.planning.scene import assets_of_plan
from dataset_builder.planning.scene.assets_of_plan import asset_of, room_shell, world_from_object
from dataset_builder.rendering.examples import render_view
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.scene_files import SceneFolders, scene_files
from tests.assets.gltf_files import GltfMaker
from tests.assets.gltf_scenes import add_mesh, matrix, plain

LAYERS = (("i_t", "frame"), ("depth", "frame"), ("instance", "frame"))
REPETITIONS = 24
FAILURES = 1e-3
"""That a test of equal pictures fails by chance."""


@pytest.fixture
def plan(small_spec: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ExamplePlan]:
    """A view of the small dataset, all of whose materials are plain: glTF has no floats as texels."""
    for name in ("make_room", "make_furniture"):
        made = getattr(assets_of_plan, name)
        monkeypatch.setattr(assets_of_plan, name, lambda made=made, **how: _plain(made(**how)))
    found = plan_example(load_dataset(small_spec), 1)
    # Other names than elsewhere: what was made of them before is remembered
    yield found.model_copy(update={
        "room": found.room.model_copy(update={"name": "plain"}), "target": _renamed(found.target),
        "furniture": tuple(map(_renamed, found.furniture)),
        "render": found.render.model_copy(update={"layers": LAYERS})})
    # What was made plain is remembered, too
    room_shell.cache_clear()
    assets_of_plan.ASSETS.cache_clear()


def _plain(made: Any) -> Any:
    return {name: plain(asset) for name, asset in made.items()} if isinstance(made, dict) else plain(made)


def _renamed(placed: Any) -> Any:
    return placed.model_copy(update={"object": placed.object.model_copy(update={"name": f"plain {placed.instance}"})})


def as_file(plan: ExamplePlan, folder: Path) -> ExamplePlan:
    """The same view of the same room and furniture out of a glTF file."""
    made = GltfMaker()
    for name, asset in room_shell(plan.room).items():
        made.add("nodes", name=name, mesh=add_mesh(made, asset))
    for placed in plan.furniture:
        made.add("nodes", name=f"Object_{placed.instance}", mesh=add_mesh(made, asset_of(placed.object, folder)),
                 matrix=matrix(world_from_object(placed)))
    made.write(folder / "room.glb")
    source = SceneSource(source="room.glb", licence="CC0-1.0", parts=(PartPatterns(part="object", patterns=("Ob*",)),),
                         source_sha256=scene_files(SceneFolders.of(folder, "room.glb", (), "", "")).digest)
    things = tuple(SceneThingPlan(instance=placed.instance, name=f"Object_{placed.instance}", category="",
                                  licence="CC0-1.0") for placed in plan.furniture)
    room: RoomPlan = plan.room.model_copy(update={"kind": "file", "scene": SceneFilePlan(file=source, things=things)})
    return plan.model_copy(update={"room": room, "furniture": ()})


def pictures(plan: ExamplePlan, folder: Path, seeds: range) -> dict[str, np.ndarray]:
    """Layers of a view by name, one for each seed."""
    found = []
    for seed in seeds:
        render = plan.render.model_copy(update={"seed": str(seed)})
        example, = render_view([plan.model_copy(update={"render": render})], folder)
        found.append(example.layers)
    return {name: np.stack([layers[name] for layers in found]).astype(float) for name, _ in LAYERS}


def test_the_same_pictures(plan: ExamplePlan, tmp_path: Path) -> None:
    """Welch's t of every 4 x 4 block of i_t over 24 seeds of either, no seed twice, all blocks and channels together
    at a rate of 1 in 1000; what is no light is equal."""
    first = pictures(plan, tmp_path, range(REPETITIONS))
    second = pictures(as_file(plan, tmp_path), tmp_path, range(REPETITIONS, 2 * REPETITIONS))
    assert set(np.unique(first["instance"])) >= {1, 2} and len(plan.furniture) == 1
    np.testing.assert_array_equal(first["instance"], second["instance"])
    again = pictures(as_file(plan, tmp_path), tmp_path, range(1))["depth"]
    # Corners are rounded to single precision: a sample at an edge may fall to its other side
    assert np.quantile(np.abs(first["depth"][:1] - again), 0.95) < 1e-4
    blocks = [each["i_t"].reshape(REPETITIONS, 5, 4, 6, 4, 3).mean(axis=(2, 4)) for each in (first, second)]
    assert all(each.std(axis=0).min() > 0 for each in blocks)
    p = stats.ttest_ind(*blocks, axis=0, equal_var=False).pvalue
    assert p.min() > FAILURES / p.size


def test_a_scene_from_a_file_needs_no_other_kernel(plan: ExamplePlan, tmp_path: Path) -> None:
    kernels = []
    for each in (plan, as_file(plan, tmp_path)):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            pictures(each, tmp_path, range(1))
            kernels.append({kernel["hash"] for kernel in dr.kernel_history()
                            if kernel.get("operation_count", 0) > 1000})
    assert kernels[0] and kernels[0] == kernels[1]
