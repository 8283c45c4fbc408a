"""Talks to Blender's interpreter, a process of its own: `Blender` renders with Cycles, gives back arrays and times."""

import json
import os
import subprocess
import sys
import tempfile
import venv
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import OpenEXR

SIDE = Path(__file__).with_name("blender_side.py")
PACKAGE = "bpy>=5.0"
CHANNELS = {"ViewLayer.Combined": "combined", "ViewLayer.Diffuse Direct": "diffuse_direct",
            "ViewLayer.Diffuse Indirect": "diffuse_indirect", "ViewLayer.Diffuse Color": "diffuse_color",
            "ViewLayer.Glossy Color": "glossy_color", "Composite.Combined": "composite"}
"""Names of passes in Blender's files and here."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CyclesImage:
    """passes: name -> (H, W, C) float32; seconds: of the render call, in Blender's process."""

    passes: dict[str, np.ndarray]
    seconds: float


def make_environment(folder: Path) -> Path:
    """Python of a virtual environment in `folder` that has bpy; made where it is not there."""
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if not python.exists():
        print(f"making Blender's environment in {folder}", file=sys.stderr)
        venv.create(folder, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", PACKAGE], check=True)
    return python


class Blender(AbstractContextManager["Blender"]):
    """One Blender process that runs a `side`; the one of this folder can `load` a scene folder, `show` one of its
    renders, and `render`."""

    def __init__(self, python: Path, threads: int, side: Path = SIDE):
        self._folder = tempfile.TemporaryDirectory(prefix="cycles-")
        self._log = open(Path(self._folder.name) / "blender.log", "w+")  # noqa: SIM115
        self._process = subprocess.Popen([python, str(side), str(threads)], stdin=subprocess.PIPE,
                                         stdout=subprocess.PIPE, stderr=self._log, text=True)
        self.version: str = self._answer()["version"]

    def load(self, folder: Path) -> None:
        """Build the scene that `scene_file.write` wrote."""
        self.ask(do="load", folder=str(folder))

    def show(self, name: str, bounces: int) -> None:
        """Choose the render: source, target or rough."""
        self.ask(do="show", name=name, bounces=bounces)

    def render(self, *, spp: int, seed: int, threshold: float = 0.0, denoise: str = "",
               window: tuple[int, int, int, int] | None = None, passes: Sequence[str] = ()) -> CyclesImage:
        """Render what is shown; window: left, top, right, bottom, the only pixels that are wanted.

        threshold > 0 is adaptive sampling with at most `spp`. denoise: "combined", "shading" (the diffuse light, into
        the pass `composite`) or none.
        """
        out = Path(self._folder.name) / "passes.exr"
        answer = self.ask(do="render", spp=spp, seed=seed, threshold=threshold, denoise=denoise, window=window,
                           passes=list(passes), out=str(out))
        return CyclesImage(passes=read_passes(out), seconds=answer["seconds"])

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        # Leaving a Popen closes its pipes, which ends the process, and waits
        self._process.__exit__(kind, error, trace)
        self._log.close()
        self._folder.cleanup()

    def ask(self, **order: Any) -> dict[str, Any]:
        """The answer to one order. Raises RuntimeError where the process ended."""
        print(json.dumps(order), file=self._process.stdin, flush=True)
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        for line in self._process.stdout or ():
            return json.loads(line)
        self._log.seek(0)
        raise RuntimeError(f"Blender's process ended:\n{self._log.read()[-2000:]}")


def read_passes(path: Path) -> dict[str, np.ndarray]:
    """name -> (H, W, C) float32 of a multi-layer file."""
    found: dict[str, dict[str, np.ndarray]] = {}
    with OpenEXR.File(str(path), separate_channels=True) as file:
        for part in file.parts:
            for name, channel in part.channels.items():
                layer, _, component = name.rpartition(".")
                if layer in CHANNELS and component != "A":
                    found.setdefault(CHANNELS[layer], {})[component] = channel.pixels
    return {name: np.stack([planes[key] for key in sorted(planes, key="RGB".index)], axis=-1)
            for name, planes in found.items()}
