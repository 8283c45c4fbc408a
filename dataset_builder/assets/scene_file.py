"""Scene files -> SceneModel."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from dataset_builder.assets.file_model import refuse
from dataset_builder.assets.image_maps import half_texels
from dataset_builder.assets.scene_model import SceneModel
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


def load_scene(source: SceneSource, root: Path, *, max_texture: int = 1024) -> SceneModel:
    """The scene that a source names, in metres, Z up. Its textures are float16; equal ones are one.

    Raises UserError: no such file, another format, unreadable, a file that it needs is missing, nothing in it.
    """
    path = root / source.source
    if path.suffix.lower() not in READERS:
        refuse(path, f"expected a scene file that ends in one of {' '.join(READERS)}, got {path.suffix or 'none'}")
    with half_texels():
        model = READERS[path.suffix.lower()](source, root, max_texture)
    return replace(model, things=sharing_textures(model.things))
