"""glTF 2.0 (.gltf, .glb) -> FileModel: what the scene draws, at the pose that the file states.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
"""

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dataset_builder.assets.file_model import FileMaterial, FileModel, FilePart, counted, refuse
from dataset_builder.assets.readers.gltf_extensions import PREFIX, TAKEN
from dataset_builder.assets.readers.gltf_file import MESHOPT, GltfFile, listed, open_gltf
from dataset_builder.assets.readers.gltf_images import BASIS, READ_BY_PILLOW, GltfImages
from dataset_builder.assets.readers.gltf_inventory import contents, left_aside
from dataset_builder.assets.readers.gltf_materials import GltfMaterial, GltfMaterials
from dataset_builder.assets.readers.gltf_nodes import INSTANCING, VISIBILITY, Placed, Placement, node_tree, place_meshes
from dataset_builder.assets.readers.gltf_primitives import (
    DRACO,
    TRIANGLES,
    GltfShape,
    mode_of,
    read_shape,
    triangle_count,
)
from dataset_builder.assets.readers.gltf_values import Entry
from dataset_builder.spec.mesh_source import splat_hint

HONOURED = frozenset({
    "KHR_mesh_quantization", "KHR_texture_transform", "KHR_materials_variants", DRACO, INSTANCING, VISIBILITY, BASIS,
    *MESHOPT, *READ_BY_PILLOW,
    *(PREFIX + name for name in TAKEN)})
"""Extensions that a file may require."""
MOST_CORNERS = 2**27
"""Corners of triangles and vertices of all parts together: files can place a mesh any number of times."""


def read(path: Path, max_texture: int) -> FileModel:
    """The scene of a glTF file. Textures have sides of at most `max_texture` texels. Raises UserError."""
    with gltf_reading(path, max_texture) as reading:
        return reading.model()


@contextmanager
def gltf_reading(path: Path, max_texture: int, roots: Sequence[Path] = (), *,
                 besides: frozenset[str] = frozenset()) -> Iterator["GltfReading"]:
    """A file that is being read. roots: folders, beside its own, that it may name files in. besides: extensions that
    the caller honours. Raises UserError."""
    try:
        gltf = open_gltf(path, roots)
        _check_required(gltf, HONOURED | besides)
        with np.errstate(all="ignore"):
            yield GltfReading(gltf, GltfMaterials(images=GltfImages(gltf=gltf, max_size=max_texture)))
    except RecursionError:
        refuse(path, "expected JSON that is not nested without end")


def _check_required(gltf: GltfFile, honoured: frozenset[str]) -> None:
    unknown = [name for name in gltf.root.names("extensionsRequired") if name not in honoured]
    if unknown:
        gltf.root.refuse(f"expected only extensions that are honoured, got a need of {listed(unknown)}",
                         splat_hint(unknown) or "export the model without it, or convert it with gltf-transform",
                         key="extensionsRequired")


@dataclass(eq=False)
class GltfReading:
    """One file on its way to a model."""

    gltf: GltfFile
    materials: GltfMaterials
    notes: list[str] = field(default_factory=list)
    """What is left out of primitives."""
    corners: int = 0
    plain: int = 0
    """Primitives without a material."""
    taken: dict[str, Entry] = field(default_factory=dict)
    """Primitives that were read, by where they stand."""
    shapes: dict[tuple[str, tuple[float, ...]], GltfShape] = field(default_factory=dict)
    morphed: bool = False

    def model(self) -> FileModel:
        """All of it."""
        placed = place_meshes(self.gltf, node_tree(self.gltf))
        parts = tuple(part for placement in placed.placements for part in self.parts(placement))
        return FileModel(parts=parts, materials=self.used_materials(), contains=self.contains(placed),
                         left_out=self.left_out(placed, ("cameras", "lights")))

    def used_materials(self) -> tuple[FileMaterial, ...]:
        """Those of the parts so far, in the order of their indices."""
        return tuple(material.taken for material in self.materials.used.values())

    def contains(self, placed: Placed) -> str:
        """What the file holds and what has been taken of it."""
        return contents(self.gltf, placed, self.taken, materials=len(self.materials.used),
                        images=len(self.materials.images.used))

    def left_out(self, placed: Placed, besides: Collection[str]) -> tuple[str, ...]:
        """What has not been taken, and what was decided. besides: of cameras and lights, what is no part of it."""
        used = tuple(self.materials.used.values())
        return (*placed.left_out, *dict.fromkeys(self.notes), *left_aside(self.gltf, HONOURED, besides),
                *self._decided(placed, used))

    def _decided(self, placed: Placed, used: tuple[GltfMaterial, ...]) -> list[str]:
        """What was chosen where the file leaves a choice, in words."""
        decided = [*placed.decided]
        if self.morphed:
            decided.append("morph targets at the weights that the file states")
        if self.plain:
            decided.append(f"{counted(self.plain, 'primitive')} without a material")
        if not all(material.two_sided for material in used):
            decided.append("one-sided surfaces are seen from both sides")
        if any(mesh.has("primitives") and any(primitive.extension("KHR_materials_variants") for primitive in
                                              mesh.entries("primitives")) for mesh in self.gltf.lists["meshes"]):
            decided.append("of the material variants the default")
        return decided

    def parts(self, placement: Placement) -> Iterator[FilePart]:
        """Every primitive of a mesh, everywhere that its placement says."""
        mesh = self.gltf.lists["meshes"][placement.mesh]
        if not (primitives := mesh.entries("primitives")):
            mesh.refuse("expected primitives", key="primitives")
        for primitive in primitives:
            if mode_of(primitive) >= TRIANGLES:
                # A strip or a fan may be too short to have any
                if triangle_count(self.gltf, primitive):
                    yield from self._placed(placement, mesh, primitive)
                self.taken[primitive.at] = primitive

    def _placed(self, placement: Placement, mesh: Entry, primitive: Entry) -> Iterator[FilePart]:
        index = primitive.index("material", self.gltf.lists["materials"], "materials")
        place = -1 if index is None else self.materials.place_of(index)
        material = None if index is None else self.materials.used[index]
        if primitive.at not in self.taken:
            self.plain += material is None
        shape = self._shape(placement, mesh, primitive, material)
        moves = [np.eye(4)] if placement.joints is not None else list(placement.places)
        self.corners += len(moves) * (shape.faces.size + len(shape.positions))
        if self.corners > MOST_CORNERS:
            placement.node.refuse(f"expected at most {MOST_CORNERS:,} corners and vertices in all, got more, counted "
                                  "wherever a node puts them")
        for move in moves:
            yield self._part(placement, primitive, shape, place, material, move)

    def _shape(self, placement: Placement, mesh: Entry, primitive: Entry, material: GltfMaterial | None) -> GltfShape:
        targets = len(primitive.entries("targets"))
        source = placement.node if placement.node.has("weights") else mesh
        weights = tuple(source.numbers("weights", (0.0,) * targets).tolist())
        self.morphed |= targets > 0
        # A mesh may be read once with its skin and once without
        key = (f"{primitive.at} {placement.joints is not None}", weights)
        if key not in self.shapes:
            self.shapes[key] = read_shape(self.gltf, primitive, weights=weights, skinned=placement.joints is not None,
                                          uv_set=None if material is None else material.uv_set)
            self._note(primitive, self.shapes[key], material)
        return self.shapes[key]

    def _note(self, primitive: Entry, shape: GltfShape, material: GltfMaterial | None) -> None:
        self.notes += [f"{primitive.at}: {note}" for note in shape.notes]
        if material is None:
            return
        name = material.taken.material.name
        if material.uv_set is not None and shape.uvs is None:
            self.notes.append(f"{primitive.at}: the textures of {name}, since it has no TEXCOORD_{material.uv_set}")
        if material.unlit and shape.colors is not None:
            self.notes.append(f"{primitive.at}: vertex colours, since {name} is unlit")

    def _part(self, placement: Placement, primitive: Entry, shape: GltfShape, place: int, material: GltfMaterial | None,
              move: np.ndarray) -> FilePart:
        """A shape moved by the joints of its skin, or by a matrix where there is none."""
        if placement.joints is not None:
            positions, mirrored = _skinned(primitive, shape, placement, placement.joints)
        else:
            positions = shape.positions @ move[:3, :3].T + move[:3, 3]
            mirrored = bool(np.linalg.det(move[:3, :3]) < 0)
        if not np.isfinite(positions).all():
            placement.node.refuse("expected a matrix that keeps vertices finite")
        faces = shape.faces[:, [0, 2, 1]] if mirrored else shape.faces
        uvs, colors = {}, None
        if material is not None and material.uv_set is not None:
            flipped = np.zeros((len(positions), 2)) if shape.uvs is None else shape.uvs
            uvs[material.uv_set] = np.stack([flipped[:, 0], 1 - flipped[:, 1]], axis=1)[faces]
        if shape.colors is not None and not (material is not None and material.unlit):
            colors = shape.colors[faces]
            if material is None or material.opaque:
                colors[..., 3] = 1
        used = np.zeros(len(positions), bool)
        used[faces] = True
        return FilePart(name=f"{placement.node.title}, {primitive.at}", positions=positions[used],
                        faces=(np.cumsum(used) - 1)[faces], material=place, uvs=uvs, colors=colors)


def _skinned(primitive: Entry, shape: GltfShape, placement: Placement,
             matrices: np.ndarray) -> tuple[np.ndarray, bool]:
    """Positions moved by the mean of their joints' (J, 4, 4) `matrices` (section 3.7.3.3), and whether most of it is
    mirrored.

    Weights are made to add up to 1; vertices without any stay where their node is.
    """
    blended = np.zeros((len(shape.positions), 3, 4))
    total = np.zeros(len(shape.positions))
    for joints, weights in shape.influences:
        if (wrong := joints[weights > 0]).size and wrong.max() >= len(matrices):
            primitive.refuse(f"expected joints below {len(matrices)}, got {wrong.max()}", key="attributes")
        for column in range(4):
            own = weights[:, column]
            moves = matrices[np.where(own > 0, joints[:, column], 0), :3]
            blended += np.where(own > 0, own, 0)[:, None, None] * moves
            total += np.where(own > 0, own, 0)
    free = total <= 0
    blended[free], total[free] = placement.places[0][:3], 1
    blended /= total[:, None, None]
    moved = np.einsum("vij,vj->vi", blended[:, :, :3], shape.positions) + blended[:, :, 3]
    return moved, bool(np.median(np.linalg.det(blended[:, :, :3])) < 0)
