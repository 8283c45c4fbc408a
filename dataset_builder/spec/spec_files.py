"""Every file that a spec consists of, so that it can be taken to where they are not."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.spec.scene_files import SCENE_REFERENCES, SceneFolders


@dataclass(frozen=True, kw_only=True)
class SpecFiles:
    """What a spec is made of, on this machine."""

    top: Path
    """Folder that holds all of it."""
    files: tuple[str, ...]
    """Relative to `top`, sorted."""
    folders: tuple[str, ...]
    """That must be there though no file may lie in them."""
    spec: str
    """The dataset file."""

    @classmethod
    def of(cls, loaded: LoadedSpec) -> "SpecFiles":
        """Of a spec that was loaded here. Files that it names by an absolute path are left out: such a name leads
        nowhere else."""
        spec = os.path.abspath(loaded.path)
        root = Path(spec).parent
        files = {os.path.abspath(root / name) for name in _files(loaded, root)} | {spec}
        folders = {os.path.abspath(root / name) for name in _folders(loaded) if not os.path.isabs(name)}
        top = os.path.commonpath([*map(os.path.dirname, files), *folders])
        return cls(top=Path(top), files=tuple(sorted(os.path.relpath(file, top) for file in files)),
                   folders=tuple(sorted(os.path.relpath(folder, top) for folder in folders)),
                   spec=os.path.relpath(spec, top))


def _files(loaded: LoadedSpec, root: Path) -> Iterator[str | Path]:
    """Paths relative to the folder of the dataset file."""
    keys = [*loaded.objects, *loaded.scenes, *loaded.rooms]
    yield from (name for name in (*keys, *loaded.images, *loaded.pose_files) if not os.path.isabs(name))
    for key, source in loaded.meshes.items():
        name = loaded.objects[key].file or ""
        if not os.path.isabs(key) and not os.path.isabs(name):
            mesh = Path(key).parent / name
            yield from (mesh, *(mesh.parent / companion for companion in source.companions))
    for key in loaded.scene_files:
        file = loaded.scenes[key].file
        if file is not None and not os.path.isabs(file.path):
            scene = SceneFolders.of(root, file.path, file.roots, file.models, file.textures)
            yield file.path
            yield from (Path(file.path).parent / reference.name
                        for reference in SCENE_REFERENCES[scene.path.suffix.lower()](scene))


def _folders(loaded: LoadedSpec) -> Iterator[str]:
    for key in loaded.scene_files:
        file = loaded.scenes[key].file
        if file is not None:
            yield from (name for name in (*file.roots, file.models, file.textures) if name)
