"""Scene files -> SceneModel."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from dataset_builder.assets.file_model import counted, refuse
from dataset_builder.assets.image_maps import half_texels
from dataset_builder.assets.scene_model import SceneModel, SceneThing
from dataset_builder.assets.scene_readers import front3d, mesh_scene, usd_scene
from dataset_builder.assets.scene_readers.shared_textures import sharing_textures
from dataset_builder.label.scene_source import SceneSource
from dataset_builder.spec.usd_references import USD_SUFFIXES
from dataset_builder.spec.usual_sizes import length

Reader = Callable[[SceneSource, Path, int], SceneModel]
"""What reads a scene: a function of the source, the folder that its paths are relative to, and the longest side of a
texture. It raises nothing but UserError, whatever the bytes are: what the file says is in the model, in its `left_out`
or `faults`, or refused."""
READERS: dict[str, Reader] = {
    **dict.fromkeys(mesh_scene.MESH_SCENES, mesh_scene.read),
    **dict.fromkeys(USD_SUFFIXES, usd_scene.read),
    ".json": front3d.read,
}
"""What reads a file, by its suffix."""
FURTHEST = 1e6
"""Metres from the origin; single precision tells places there apart by 12 cm."""
SINGLE = 2.0**-23
"""Relative step between numbers of single precision."""
COARSE = 1e-3
"""Share of a thing's size that this step may be, above which its surface is another."""


def load_scene(source: SceneSource, root: Path, *, max_texture: int = 1024) -> SceneModel:
    """The scene that a source names, in metres, Z up. Its textures are float16; equal ones are one.

    Raises UserError: no such file, another format, unreadable, a file that it needs is missing, nothing in it,
    something of it is too far away.
    """
    path = root / source.source
    if path.suffix.lower() not in READERS:
        refuse(path, f"expected a scene file that ends in one of {' '.join(READERS)}, got {path.suffix or 'none'}")
    with half_texels():
        model = READERS[path.suffix.lower()](source, root, max_texture)
    coarse: list[str] = []
    for thing in model.things:
        reach, size = _reach(thing)
        if not reach <= FURTHEST:
            refuse(path, f"expected things within {FURTHEST / 1000:,.0f} km of the origin, got one that reaches to "
                         f"{reach / 1000:.3g} km", "correct its transform or the units of the file", at=thing.name)
        if (step := SINGLE * reach) > COARSE * size:
            coarse.append(f"{thing.name} lies {reach / 1000:.3g} km from the origin, where single precision tells "
                          f"places {length(step)} apart")
    more = len(coarse) - 1
    said = tuple(coarse) if more < 1 else (f"{coarse[0]}, and {counted(more, 'other thing')} likewise",)
    return replace(model, things=sharing_textures(model.things), faults=(*model.faults, *said))


def _reach(thing: SceneThing) -> tuple[float, float]:
    """Largest coordinate of a thing in the world, and the longest side of its box, metres."""
    points, linear = thing.asset.mesh.positions, thing.world[:3, :3]
    low, high = points.min(axis=0), points.max(axis=0)
    half = np.abs(linear) @ (high - low) / 2
    middle = linear @ ((low + high) / 2) + thing.world[:3, 3]
    return float((np.abs(middle) + half).max()), float(2 * half.max())
