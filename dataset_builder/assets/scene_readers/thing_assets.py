"""Parts of a file -> the asset of a thing, and the digest of what it is made of."""

from dataclasses import fields, replace

import numpy as np

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.assets.file_model import FileModel
from dataset_builder.assets.mesh_file import model_asset
from dataset_builder.digest import digest, pixel_digest
from dataset_builder.geometry.mesh import TriangleMesh


def thing_asset(model: FileModel, world_from_file: np.ndarray, *, name: str, category: str,
                licence: str) -> tuple[Asset, str]:
    """The asset of the parts of a model, with the materials that they use, and its `content`. Faults of its shape are
    not looked for: they matter once it is a target.

    world_from_file: (4, 4) affine map to metres with Z up. Raises UserError for what is no surface.
    """
    used = sorted({part.material for part in model.parts if part.material >= 0})
    ranks = {index: rank for rank, index in enumerate(used)} | {-1: -1}
    parts = tuple(replace(part, material=ranks[part.material]) for part in model.parts)
    materials = tuple(model.materials[index] for index in used)
    asset = model_asset(replace(model, parts=parts, materials=materials), world_from_file, name=name,
                        category=category, licence=licence, look=False)
    known = [each.content or made_of(each.material) for each in materials]
    return asset, content_of(asset.mesh, [*known, *map(made_of, asset.materials[len(known):])])


def content_of(mesh: TriangleMesh, materials: list[str]) -> str:
    """Digest of a mesh and of the digests of its materials; names do not count."""
    arrays = [mesh.positions, mesh.faces, mesh.uvs, mesh.material, *([] if mesh.colors is None else [mesh.colors])]
    return digest([[pixel_digest(array) for array in arrays], materials])


def made_of(material: Material) -> str:
    """Digest of a material whose reader makes none: its factors, and its texels as they were read."""
    texture = material.texture
    texels = {} if texture is None else {each.name: pixel_digest(value) for each in fields(texture) if isinstance(
        value := getattr(texture, each.name), np.ndarray)}
    return digest([{each.name: getattr(material, each.name) for each in fields(material)
                    if each.name not in ("name", "texture")}, texels])
