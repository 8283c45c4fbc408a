"""Meshes that a 3D-FRONT scene holds itself -> assets: their part of the building by type, colours and textures."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.assets.file_model import ROUGHNESS, FileMaterial, FileModel, FilePart
from dataset_builder.assets.image_maps import ImageFile, make_texture, read_texels
from dataset_builder.assets.linear_texels import linear_rgba
from dataset_builder.assets.scene_model import Role
from dataset_builder.assets.scene_readers.front3d_json import FrontScene
from dataset_builder.assets.scene_readers.front3d_meshes import FrontMaterial, FrontMesh
from dataset_builder.assets.scene_readers.front3d_models import WORLD_FROM_FRONT, FrontModel, rule_of
from dataset_builder.assets.scene_readers.front3d_values import FaultNotes
from dataset_builder.assets.scene_readers.thing_assets import thing_asset
from dataset_builder.digest import digest, sha256_file
from dataset_builder.errors import UserError
from dataset_builder.spec.file_reference import MOST_BYTES
from dataset_builder.spec.front3d_references import texture_file

ROLE_WORDS: tuple[tuple[Role, tuple[str, ...]], ...] = (
    ("object", ("lamp", "lightband", "cabinet", "furniture", "platform", "stair", "personalized")),
    ("ceiling", ("ceil", "cornice", "beam")),
    ("floor", ("floor",)),
    ("walls", ("wall", "window", "door", "baseboard", "wainscot", "background", "column", "flue",
               "pipe", "slab", "hole", "pocket", "front", "back")),
)
"""What part of the building a type of mesh is, by words in it, the first that fits; others are objects. The types are
those that the data set's users have met (BlenderProc lists 99, furniture among them)."""


def front_role(kind: str) -> Role:
    """What part of the building a type of mesh is.

    >>> front_role("WallInner"), front_role("SmartCustomizedCeiling"), front_role("CustomizedFurniture")
    ('walls', 'ceiling', 'object')
    """
    lower = kind.lower()
    return next((role for role, words in ROLE_WORDS if any(word in lower for word in words)), "object")


@dataclass(eq=False)
class FrontBuilding:
    """The meshes of a scene, each made once."""

    scene: FrontScene
    textures: Path | None
    max_texture: int
    notes: FaultNotes
    _made: dict[str, FrontModel | None] = field(default_factory=dict)
    _materials: dict[str, FileMaterial] = field(default_factory=dict)
    _textures: dict[Path, tuple[Texture | None, str]] = field(default_factory=dict)
    unnamed: int = 0
    """Materials with a texture, where the spec names no folder of textures."""
    normal_maps: int = 0
    """Images of normals that are not read."""

    def model(self, mesh: FrontMesh, name: str) -> FrontModel | None:
        """A mesh as an asset, Z up, in the frame of the house; None for one without area, which is noted."""
        if mesh.uid not in self._made:
            self._made[mesh.uid] = self._make(mesh, name)
        return self._made[mesh.uid]

    def _make(self, mesh: FrontMesh, name: str) -> FrontModel | None:
        found = self._material(mesh, name)
        uvs = {} if mesh.uvs is None else {0: mesh.uvs[mesh.faces]}
        part = FilePart(name=name, positions=mesh.positions, faces=mesh.faces, material=0 if found else -1, uvs=uvs)
        model = FileModel(parts=(part,), materials=(found,) if found else (), contains=mesh.kind)
        try:
            asset, content = thing_asset(model, WORLD_FROM_FRONT, name=name, category=mesh.kind.lower(), licence="")
        except UserError as error:
            self.notes.add("meshes without area, left out", name, error.problems[0].rule)
            return None
        # Meshes of these files share no vertices, and sheets of walls have no inside: nothing to tell of each
        if mended := [text for text in asset.meta["repair"].split(", ") if text and not text.endswith(" welded")]:
            self.notes.add("meshes that were mended", name, ", ".join(mended))
        quiet = {"repair": ""} if front_role(mesh.kind) == "object" else {"repair": "", "shape": ""}
        return FrontModel(replace(asset, meta=asset.meta | quiet), content)

    def _material(self, mesh: FrontMesh, name: str) -> FileMaterial | None:
        """The material of a mesh; None for none, which is noted."""
        material = self.scene.materials.get(mesh.material)
        if material is None:
            self.notes.add("meshes without a material, taken for grey", name, mesh.material and
                           f"{mesh.material} is not there")
            return None
        if material.uid not in self._materials:
            self._materials[material.uid] = self._file_material(material)
        return self._materials[material.uid]

    def _file_material(self, material: FrontMaterial) -> FileMaterial:
        """A texture takes the place of the colour, as in the data set's own tools, but not of its coverage."""
        self.normal_maps += material.normal_map
        texture, content = self._texture(material)
        red, green, blue, alpha = linear_rgba(np.array([material.color]))[0].tolist()
        made = Material(name=material.uid, roughness=ROUGHNESS, alpha=alpha, texture=texture,
                        base_color=(red, green, blue) if texture is None else (1.0, 1.0, 1.0))
        uv = None if material.uv_linear is None else np.column_stack([material.uv_linear, np.zeros(2)])
        says = {"color": list(material.color), "texture": content}
        return FileMaterial(material=made, uv_transform=uv, content=digest(says))

    def _texture(self, material: FrontMaterial) -> tuple[Texture | None, str]:
        """The texture of a material and the digest of its file; None and nothing where it has none, or none that is
        read, which is noted."""
        if not material.textures:
            return None, ""
        if self.textures is None:
            self.unnamed += 1
            return None, ""
        path = next(filter(None, (texture_file(self.textures, jid) for jid in material.textures)), None)
        if path is None:
            self.notes.add("textures that are not there, plain colours instead", material.uid,
                           " or ".join(material.textures))
            return None, ""
        if path not in self._textures:
            self._textures[path] = self._read(path, material.uid)
        return self._textures[path]

    def _read(self, path: Path, uid: str) -> tuple[Texture | None, str]:
        name = f"{path.parent.name}/{path.name}"
        try:
            texels = read_texels(ImageFile(name=name, content=path), srgb=True, max_size=self.max_texture)
            if texels[..., 3].min() < 1:
                self.notes.add("textures with coverage, taken for whole", uid, name)
            return make_texture({"base_color": texels[..., :3]}), sha256_file(path, most=MOST_BYTES)
        except (UserError, OSError) as error:
            self.notes.add("textures that cannot be read, plain colours instead", uid,
                           rule_of(error, path.parent.parent) if isinstance(error, UserError) else str(error.strerror))
            return None, ""
