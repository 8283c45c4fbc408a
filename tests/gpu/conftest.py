"""Where there is a device, or where the CPU stands in for one: `TEST_GPU_BACKEND=llvm` runs the same tests with the CPU
on both sides and other random numbers, which shows that they pass where nothing is wrong."""

import json
import os
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.rendering.backend import cuda_available

ROOT = Path(__file__).resolve().parents[2]
STAND_IN = "TEST_GPU_BACKEND"
EFFECTS, MINI = ROOT / "scene_specs/3df-lighting-effects.yaml", ROOT / "scene_specs/3df-lighting-mini.yaml"
FREE = ("d", "r", "mask", "normal", "depth", "instance", "mask_rough", "normal_rough")
NOISY = ("i_s", "i_t", "s", "s_prime", "spec", "air", "i_t_empty", "i_pbr")
SMALL = ("image.width=24", "image.height=24", "render.effects=all",
         *(f"layers.{name}=frame" for name in (*FREE, *NOISY)))
JOINED = ("image.width=24", "image.height=24", "render.transport=joined",
          "layers.s=frame", "layers.spec=frame")
REPLICAS = 8
"""Renderings with other random numbers on each side, whose spread is the error."""
ASKED: dict[str, dict[str, Any]] = {
    "effects": {"spec": EFFECTS, "overrides": [*SMALL, "render.spp=16"], "examples": [0, 2, 4, 5], "layers": NOISY,
                "repeat": REPLICAS},
    "free": {"spec": EFFECTS, "overrides": [*SMALL, "render.spp=16"], "examples": [0, 2, 4, 5], "layers": FREE,
             "word": {"cpu": "", "device": ""}},
    "joined": {"spec": MINI, "overrides": [*JOINED, "render.spp=16"], "examples": [0], "repeat": REPLICAS},
    "goal": {"spec": MINI, "examples": [1], "repeat": REPLICAS,
             "overrides": ["image.width=24", "image.height=24", "render.accuracy.i_t={error: 0.2, cap: 256}"]},
    "denoised": {"spec": MINI, "overrides": ["image.width=24", "image.height=24",
                                             "render.denoise.layers=[i_t, s_prime]", "render.denoise.keep_raw=true"],
                 "examples": [2]},
    "many": {"spec": MINI, "overrides": ["image.width=16", "image.height=16", "render.spp=16"],
             "examples": list(range(8)), "repeat": 3},
}
"""What both sides render."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests that need a device are skipped where there is none, and say so."""
    if os.environ.get(STAND_IN) or cuda_available():
        return
    reason = f"needs an NVIDIA GPU, and its driver reports none ({STAND_IN}=llvm: the CPU stands in)"
    for item in items:
        if item.get_closest_marker("gpu"):
            item.add_marker(pytest.mark.skip(reason=reason))


@pytest.fixture(scope="session")
def device() -> str:
    """The backend that is tested."""
    return os.environ.get(STAND_IN) or "cuda"


class Side:
    """What one process rendered."""

    def __init__(self, path: Path):
        with np.load(path) as found:
            self.images = {name: found[name] for name in found.files if name != "figures"}
            self.figures: dict[str, Any] = json.loads(str(found["figures"]))

    def layers(self, request: str) -> dict[str, dict[str, np.ndarray]]:
        """Layers by example: (R, H, W, C), replica by replica."""
        found = defaultdict[str, dict[str, list[np.ndarray]]](lambda: defaultdict(list))
        for name, image in self.images.items():
            asked, key, layer, _ = name.split("/")
            if asked == request:
                found[key][layer].append(image)
        return {key: {layer: np.stack(images) for layer, images in layers.items()} for key, layers in found.items()}


def run_module(module: str, *words: str, fault: bool = False) -> str:
    """Run a module of tests in a process of its own; what it printed. Its fault, if any, is planted there alone."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    if not fault:
        environment.pop("TEST_GPU_FAULT", None)
    done = subprocess.run([sys.executable, "-m", module, *words], cwd=ROOT, env=environment, capture_output=True,
                          text=True, timeout=900)
    assert done.returncode == 0, done.stderr[-4000:]
    return done.stdout


def rendered(backend: str, side: str, folder: Path) -> Side:
    """Everything that is asked, by one backend."""
    requests = {name: {"layers": [], "repeat": 1, **asked, "spec": str(asked["spec"]),
                       "word": asked.get("word", {}).get(side, side)} for name, asked in ASKED.items()}
    (folder / f"{side}.json").write_text(json.dumps(requests), encoding="utf-8")
    run_module("tests.gpu.render_side", backend, str(folder / f"{side}.json"), str(folder / f"{side}.npz"),
               fault=side == "device")
    return Side(folder / f"{side}.npz")


@pytest.fixture(scope="session")
def sides(device: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Side, Side]]:
    """The CPU's and the device's."""
    folder = tmp_path_factory.mktemp("sides")
    yield rendered("llvm", "cpu", folder), rendered(device, "device", folder)
