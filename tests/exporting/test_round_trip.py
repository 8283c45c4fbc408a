"""An example, exported and read back as a scene of its own, gives the same pictures, by the same kernels."""

from pathlib import Path

import drjit as dr
import numpy as np
import pytest
from scipy import stats

from dataset_builder.exporting.export_usd import Exported
from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.plan import plan_example
from dataset_builder.rendering import plugins
from dataset_builder.rendering.backend import activate
from dataset_builder.rendering.examples import render_view
from dataset_builder.spec.load import load_dataset

SCENE = """\
file:
  path: STAGE
  licence: CC0-1.0
  lights: {use: kept, scale: 1}
  cameras: own
"""
DATASET = """\
name: back
seed: 77
image: {width: 24, height: 20}
layers: {i_s: frame, i_t: frame, depth: frame, instance: frame}
render: {spp: 16, max_depth: 4}
rough: {edge_length: 0.2, rounds: 0}
splits:
  - name: train
    objects: {count: 1, things: {name: /Example/Target}}
    scenes: {count: 1, from: [scene.yaml]}
"""
LAYERS = (("i_s", "frame"), ("i_t", "frame"), ("depth", "frame"), ("instance", "frame"))
REPETITIONS = 24
FAILURES = 1e-3
"""That a test of equal pictures fails by chance."""
BRIGHTER = 1.03
"""What such a test must notice."""


@pytest.fixture(scope="module")
def back(exported: Exported) -> tuple[ExamplePlan, Path]:
    """The plan of the only example of the stage, and the folder of its spec."""
    folder = exported.stage.parent.parent
    (folder / "scene.yaml").write_text(SCENE.replace("STAGE", exported.stage.relative_to(folder).as_posix()))
    (folder / "back.yaml").write_text(DATASET)
    return plan_example(load_dataset(folder / "back.yaml"), 0), folder


@pytest.fixture
def there(label: ExampleLabel) -> ExamplePlan:
    """The plan that was exported, for the same layers."""
    return label.plan.model_copy(update={"render": label.plan.render.model_copy(update={"layers": LAYERS})})


def test_the_plan_comes_back(there: ExamplePlan, back: tuple[ExamplePlan, Path]) -> None:
    """To single precision, which stages have, but for what each file calls things."""
    plan, _ = back
    assert plan.room.kind == "usd" and plan.target.object.kind == "thing"
    assert plan.target.position == pytest.approx(there.target.position, abs=1e-6)
    assert plan.target.yaw == pytest.approx(there.target.yaw, abs=1e-6)
    assert plan.camera.position == pytest.approx(there.camera.position, abs=1e-6)
    assert plan.camera.fov == pytest.approx(there.camera.fov, rel=1e-6)
    assert plan.effects.features == there.effects.features
    for one, other in zip(plan.target_light.lights, there.target_light.lights, strict=True):
        assert (one.kind, one.position) == (other.kind, pytest.approx(other.position, abs=1e-6))
        assert one.radiance == pytest.approx(other.radiance, rel=1e-6)
        assert one.size == pytest.approx(other.size, rel=1e-6)
    assert [(thing.name, thing.category, thing.instance) for thing in plan.room.scene.things] == [
        ("/Example/Furniture/train_scene00_stool_00", "stool", 3)]
    assert plan.target.object.category == there.target.object.category


def pictures(plan: ExamplePlan, folder: Path, seeds: range) -> dict[str, np.ndarray]:
    """Layers of a view by name, one for each seed."""
    activate("llvm", 0)
    plugins.register()
    found = []
    for seed in seeds:
        render = plan.render.model_copy(update={"seed": str(seed)})
        example, = render_view([plan.model_copy(update={"render": render})], folder)
        found.append(example.layers)
    return {name: np.stack([layers[name] for layers in found]).astype(float) for name, _ in LAYERS}


def test_the_pictures_come_back(there: ExamplePlan, back: tuple[ExamplePlan, Path], small_spec: Path) -> None:
    """Welch's t of every 4 x 4 block of i_s and of i_t over 24 seeds of either, no seed twice, all blocks and channels
    of a layer together at half the rate of 1 in 1000; what is no light is equal."""
    first = pictures(there, small_spec.parent, range(REPETITIONS))
    second = pictures(*back, range(REPETITIONS, 2 * REPETITIONS))
    assert set(np.unique(first["instance"])) >= {1, 2}
    np.testing.assert_array_equal(first["instance"], second["instance"])
    again = pictures(*back, range(1))["depth"]
    # Corners are rounded to single precision: a sample at an edge may fall to its other side
    assert np.quantile(np.abs(first["depth"][:1] - again), 0.95) < 1e-4
    for layer in ("i_s", "i_t"):
        blocks = [each[layer].reshape(REPETITIONS, 5, 4, 6, 4, 3).mean(axis=(2, 4)) for each in (first, second)]
        noisy = np.minimum(*(each.std(axis=0) for each in blocks)) > 1e-6
        np.testing.assert_allclose(*(each.mean(axis=0)[~noisy] for each in blocks), rtol=1e-4)
        p = stats.ttest_ind(*(each[:, noisy] for each in blocks), axis=0, equal_var=False).pvalue
        assert p.size > 60 and p.min() > FAILURES / 2 / p.size, layer
        brighter = stats.ttest_ind(blocks[0][:, noisy], BRIGHTER * blocks[1][:, noisy], axis=0, equal_var=False).pvalue
        assert brighter.min() < FAILURES / 2 / p.size, layer


def test_no_other_kernels(there: ExamplePlan, back: tuple[ExamplePlan, Path], small_spec: Path) -> None:
    kernels = []
    for plan, folder in ((there, small_spec.parent), back):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            pictures(plan, folder, range(1))
            kernels.append({kernel["hash"] for kernel in dr.kernel_history()
                            if kernel.get("operation_count", 0) > 1000})
    assert kernels[0] and kernels[0] == kernels[1]
