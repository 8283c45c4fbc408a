"""Scenes from files as planning and rendering share them: read once, checked to be what was planned."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from dataset_builder.assets.scene_file import load_scene
from dataset_builder.assets.scene_model import Role, SceneCamera, SceneLight, SceneModel
from dataset_builder.errors import PlanError, Problem, UserError
from dataset_builder.label.scene_plan import RoomPlan
from dataset_builder.label.scene_source import SceneSource
from dataset_builder.planning.scene.recent import Recent, bytes_of
from dataset_builder.spec.scene_files import SceneFolders, scene_files
from dataset_builder.spec.usual_sizes import category_of

KEPT_SCENES, KEPT_BYTES = 8, 1 << 30
"""Scenes in memory, and their bytes, of each process; the one in use is always there."""
KEPT_FACTS = 4096
"""Scenes whose facts are remembered: some kilobytes each."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ThingFacts:
    """What planning asks of a thing of a scene, without its mesh."""

    name: str
    category: str
    """What it is: what the file says, else what its name tells, else `object`."""
    role: Role
    faces: int
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    """Corners of its box in the world, metres."""
    world: tuple[tuple[float, ...], ...]
    """(4, 4) affine world_from_thing by rows."""
    content: str
    licence: str
    """Its own, else the scene's."""

    @property
    def size(self) -> float:
        """Longest side of its box, metres."""
        return max(b - a for a, b in zip(self.low, self.high, strict=True))


@dataclass(frozen=True, kw_only=True)
class SceneFacts:
    """What planning asks of a scene, without its meshes and textures."""

    things: tuple[ThingFacts, ...]
    lights: tuple[SceneLight, ...]
    cameras: tuple[SceneCamera, ...]
    said: tuple[str, ...]
    """What was left out of the scene and what is wrong with it, in words."""

    @property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) low and (3,) high corner of all that is in it, metres."""
        return (np.min([thing.low for thing in self.things], axis=0),
                np.max([thing.high for thing in self.things], axis=0))


_models = Recent[SceneModel](KEPT_SCENES, KEPT_BYTES, lambda model: bytes_of(thing.asset for thing in model.things))


def scene_model(of: RoomPlan | SceneSource, mesh_root: Path) -> SceneModel:
    """The scene of a room that comes from a file, or of a source; paths are relative to `mesh_root`.

    Raises UserError where it cannot be read, PlanError where it is not the one that was planned.
    """
    source = of.scene.file if isinstance(of, RoomPlan) else of
    return _models.get((source, mesh_root), lambda: _read(source, mesh_root))


def scene_facts(of: RoomPlan | SceneSource, mesh_root: Path) -> SceneFacts:
    """The facts of a scene, which stay when its meshes had to go; raises as `scene_model` does."""
    return _facts(of.scene.file if isinstance(of, RoomPlan) else of, mesh_root)


@lru_cache(maxsize=KEPT_FACTS)
def _facts(source: SceneSource, mesh_root: Path) -> SceneFacts:
    model = scene_model(source, mesh_root)
    things = []
    for thing in model.things:
        mesh = thing.asset.mesh
        used = mesh.positions[np.unique(mesh.faces)] if len(mesh.faces) else np.zeros((1, 3))
        corners = used @ thing.world[:3, :3].T + thing.world[:3, 3]
        things.append(ThingFacts(
            name=thing.name, category=thing.category or category_of([thing.name]), role=thing.role,
            faces=len(mesh.faces), low=tuple(corners.min(axis=0).tolist()), high=tuple(corners.max(axis=0).tolist()),
            world=tuple(map(tuple, thing.world.tolist())), content=thing.content,
            licence=thing.licence or source.licence))
    return SceneFacts(things=tuple(things), lights=model.lights, cameras=model.cameras,
                      said=(*model.left_out, *model.faults))


def _read(source: SceneSource, root: Path) -> SceneModel:
    path = root / source.source
    if (got := _digest_now(source, root)) != source.source_sha256:
        raise PlanError([Problem(where=str(path), path="", rule=f"expected content of SHA-256 {source.source_sha256}, "
                                 f"got {got}", hint="the scene, or a file that it names, changed after planning; "
                                 "plan again")])
    return load_scene(source, root)


def _digest_now(source: SceneSource, root: Path) -> str:
    """The digest of a scene as it is now, or what keeps it from being taken."""
    try:
        return scene_files(SceneFolders.of(root, source.source, source.roots, source.models, source.textures)).digest
    except (OSError, ValueError, UserError) as error:
        return str(error)
