"""Scene files -> SceneModel."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from dataset_builder.assets.file_model import refuse
from dataset_builder.assets.image_maps import half_texels
from dataset_builder.assets.scene_model import SceneModel, SceneThing
from dataset_builder.assets.scene_readers import front3d, mesh_scene, usd_scene
from dataset_builder.assets.scene_readers.shared_textures import sharing_textures
from dataset_builder.label.scene_source import SceneSource
from dataset_builder.spec.usd_references import USD_SUFFIXES

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
"""Metres from the origin; single precision tells places there apart by 6 cm."""


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
    for thing in model.things:
        if not (reach := _reach(thing)) <= FURTHEST:
            refuse(path, f"expected things within {FURTHEST / 1000:,.0f} km of the origin, got one that reaches to "
                         f"{reach / 1000:.3g} km", "correct its transform or the units of the file", at=thing.name)
    return replace(model, things=sharing_textures(model.things))


def _reach(thing: SceneThing) -> float:
    """Largest coordinate of a thing in the world, metres; of its box's corners, so perhaps a little more."""
    points = thing.asset.mesh.positions
    box = np.stack([points.min(axis=0), points.max(axis=0)]).T
    middle, half = thing.world[:3, :3] @ box.mean(axis=1) + thing.world[:3, 3], np.ptp(box, axis=1) / 2
    return float((np.abs(middle) + np.abs(thing.world[:3, :3]) @ half).max())
