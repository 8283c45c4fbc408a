"""The clean mesh of an example and its rough ones of all noise levels, made again from the labels of its view."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dataset_builder.engine.unit import FIELDS
from dataset_builder.errors import UserError
from dataset_builder.exporting.export_usd import mesh_of_field, require_files, sources
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.geometry.roughness import vertex_distances
from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.remote.open_place import place_of
from dataset_builder.rendering.scene.triangle_soup import Soup, clean, field_twin, rough_twin
from dataset_builder.shards.example_key import key_of
from dataset_builder.shards.folder import WORK
from dataset_builder.shards.open_indexes import read_indexes, read_manifest
from dataset_builder.shards.reader import open_dataset

AGREE, ROUNDING = 1e-3, 1e-6
"""How much a distance may differ from the label's, of itself, and in radii: other processors round otherwise."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LevelMesh:
    """The R3DM of one noise level."""

    label: ExampleLabel
    """Of its example."""
    rough: Soup
    """In the world."""
    distance: np.ndarray | None
    """(F, 3) from the 3DM, of its corners, in bounding radii of the 3DM; None where there is no clean mesh."""
    rms: float
    """Root mean square of the vertices' distances, in radii; 0 without a clean mesh."""
    maximum: float
    """The largest of them; 0 without a clean mesh."""

    @property
    def title(self) -> str:
        """Which level it is: `level 1 fine`."""
        plan = self.label.plan.rough
        return f"level {plan.level} {plan.name}".rstrip()

    @property
    def differs(self) -> bool:
        """Whether it is another mesh than the one that was rendered, going by the distances in the label."""
        record = self.label.record
        told = (record.roughness_rms, record.roughness_max)
        return bool(record.roughness) and not np.allclose((self.rms, self.maximum), told, AGREE, ROUNDING)


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewMeshes:
    """The meshes of one view under one light."""

    own: ExampleLabel
    """Of the example that was asked for."""
    camera: Pinhole
    clean: Soup | None
    """The 3DM in the world; None where the object is a field, which has none."""
    radius: float
    """Bounding radius of the 3DM, or of the R3DM without one, metres."""
    levels: tuple[LevelMesh, ...]
    """By number."""
    missing: tuple[str, ...]
    """What cannot be shown, and why."""


def view_meshes(folder: Path | str, text: str, mesh_root: Path, fields: Path | None) -> ViewMeshes:
    """Make the meshes of an example's view again, by the functions that render them.

    text: names the example, see `key_of`. mesh_root: folder that the labels name files relative to. fields: the one
    that keeps fields. Raises UserError for no such example, for a mesh file that is missing or changed, and for a field
    of the example that is missing; that of another level leaves the level out.
    """
    dataset = open_dataset(folder, layers=())
    own = dataset.label(key_of(dataset, text))
    plan = own.plan
    require_files(sources(plan.target), mesh_root)
    levels, missing, radius = list[LevelMesh](), list[str](), 0.0
    for label in dataset.labels(level_keys(folder, own)):
        try:
            level, radius = _level(label, mesh_root, fields)
        except UserError as error:
            if label.key == own.key:
                raise
            missing.append(f"level {label.plan.rough.level}: {error}")
        else:
            levels.append(level)
    bare = plan.rough.field.kind == "own"
    if bare:
        missing.append("no 3DM and no distances: the object is a field")
    return ViewMeshes(own=own, camera=Pinhole.of(plan.camera, plan.render.width, plan.render.height), radius=radius,
                      clean=None if bare else clean(plan.target, mesh_root), levels=tuple(levels),
                      missing=tuple(missing))


def level_keys(folder: Path | str, label: ExampleLabel) -> list[str]:
    """Keys of the examples of the same view under the same light, by noise level. Raises ShardError."""
    place = place_of(folder)
    manifest, sha256 = read_manifest(place)
    found = {example.facts.level: example.key
             for _, index in read_indexes(place, manifest, verify="size", manifest_sha256=sha256)
             for example in index.examples
             if (example.view, example.facts.light) == (label.plan.view, label.plan.light)}
    return [found[level] for level in sorted(found)]


def _level(label: ExampleLabel, mesh_root: Path, fields: Path | None) -> tuple[LevelMesh, float]:
    """A level's mesh, and the radius that its distances are in."""
    target, plan = label.plan.target, label.plan.rough
    twin = (field_twin(target, plan, mesh_root, mesh_of_field(label, fields)) if plan.field.there else
            rough_twin(target, plan, mesh_root))
    of_vertex = (None if plan.field.kind == "own" else
                 vertex_distances(twin.mesh, asset_of(target.object, mesh_root).mesh))
    return LevelMesh(label=label, rough=twin.soup, distance=None if of_vertex is None else of_vertex[twin.mesh.faces],
                     rms=twin.figures.get("rms", 0.0), maximum=twin.figures.get("maximum", 0.0)), twin.figures["radius"]


def fields_of_dataset(folder: Path | str) -> Path | None:
    """Where a build keeps the fields that it made; None where the dataset is at an address."""
    return folder / WORK / FIELDS if isinstance(folder, Path) else None
