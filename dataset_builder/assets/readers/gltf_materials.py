"""Materials of a glTF file -> FileMaterial (glTF 2.0, section 3.9)."""

from dataclasses import dataclass, field

import numpy as np

from dataset_builder.assets.asset import Material
from dataset_builder.assets.file_model import FileMaterial
from dataset_builder.assets.image_maps import make_texture
from dataset_builder.assets.normal_maps import mended_normals
from dataset_builder.assets.readers.gltf_draft import ROUNDING, Draft
from dataset_builder.assets.readers.gltf_extensions import add_extensions, make_unlit
from dataset_builder.assets.readers.gltf_images import GltfImages
from dataset_builder.assets.readers.gltf_specular import SPECULAR_GLOSSINESS, from_specular_glossiness
from dataset_builder.digest import digest

UNLIT = "KHR_materials_unlit"
NO_CHANGE = np.eye(2, 3)


@dataclass(frozen=True, kw_only=True, eq=False)
class GltfMaterial:
    """A material, and what of a primitive's attributes it takes."""

    taken: FileMaterial
    opaque: bool
    """Whether coverage means nothing."""
    two_sided: bool
    unlit: bool

    @property
    def uv_set(self) -> int | None:
        """The texture coordinates that it needs."""
        return None if self.taken.material.texture is None else self.taken.uv_set


@dataclass(frozen=True, kw_only=True, eq=False)
class GltfMaterials:
    """The materials that parts use, in order of their first use, by their indices in the file."""

    images: GltfImages
    used: dict[int, GltfMaterial] = field(default_factory=dict)

    def place_of(self, index: int) -> int:
        """Where a material of the file stands among those used. Raises UserError for one that cannot be read."""
        if index not in self.used:
            names = {other.taken.material.name for other in self.used.values()}
            self.used[index] = read_material(self.images, index, names)
        return list(self.used).index(index)


def read_material(images: GltfImages, index: int, names: set[str]) -> GltfMaterial:
    """One material, with a name that is not among `names`: the second `wood` is `wood_2`."""
    entry = images.gltf.lists["materials"][index]
    draft = Draft(entry=entry, images=images)
    if (found := entry.extension(SPECULAR_GLOSSINESS)) is not None:
        coverage = from_specular_glossiness(draft, found)
    else:
        coverage = _metallic_roughness(draft)
    opaque = _add_coverage(draft, *coverage)
    if unlit := entry.extension(UNLIT) is not None:
        make_unlit(draft)
    else:
        _add_normal(draft)
        add_extensions(draft)
    layout = draft.layout
    texture = make_texture(draft.maps) if layout is None else make_texture(draft.maps, wrap=layout.wrap,
                                                                           nearest=layout.nearest)
    name = _own_name(entry.text("name") or f"material_{index}", names)
    material = Material(name=name, texture=texture, **draft.factors)
    moved = layout is not None and not np.allclose(layout.transform, NO_CHANGE)
    content = digest([draft.factors, draft.sources, [*layout.transform.ravel().tolist(), *layout.wrap, layout.nearest]
                      if layout else []])
    taken = FileMaterial(material=material, uv_set=layout.uv_set if layout else 0, left_out=tuple(draft.left_out),
                         content=content, uv_transform=layout.transform if layout is not None and moved else None)
    return GltfMaterial(taken=taken, opaque=opaque, two_sided=entry.flag("doubleSided"), unlit=unlit)


def _own_name(name: str, names: set[str]) -> str:
    number, made = 1, name
    while made in names:
        number += 1
        made = f"{name}_{number}"
    return made


def _metallic_roughness(draft: Draft) -> tuple[float, np.ndarray | None]:
    """Section 3.9.2: factors are linear and default to 1. Returns the base colour's coverage, factor and map."""
    base = draft.entry.entry("pbrMetallicRoughness")
    factor = base.numbers("baseColorFactor", (1, 1, 1, 1))
    red, green, blue, coverage = np.clip(factor, 0, 1).tolist()
    if (abs(factor - (red, green, blue, coverage)) > ROUNDING).any():
        draft.left_out.append(f"baseColorFactor {factor.tolist()}, cut to [0, 1]")
    draft.factors |= {"base_color": (red, green, blue), "roughness": draft.share(base, "roughnessFactor", 1),
                      "metallic": draft.share(base, "metallicFactor", 1)}
    texels = draft.texels(base, "baseColorTexture", srgb=True)
    if texels is not None:
        draft.maps["base_color"] = texels[..., :3]
    surface = draft.texels(base, "metallicRoughnessTexture")
    if surface is not None:
        draft.maps |= {"roughness": surface[..., 1], "metallic": surface[..., 2]}
    return coverage, None if texels is None else texels[..., 3]


def _add_coverage(draft: Draft, factor: float, texels: np.ndarray | None) -> bool:
    """Section 3.9.4: OPAQUE, which it returns, MASK or BLEND."""
    mode = draft.entry.text("alphaMode", "OPAQUE")
    if mode not in ("OPAQUE", "MASK", "BLEND"):
        draft.entry.refuse(f"expected OPAQUE, MASK or BLEND, got {mode}", key="alphaMode")
    if mode == "OPAQUE":
        return True
    draft.factors["alpha"] = factor
    if texels is not None and (texels < 1).any():
        draft.maps["alpha"] = texels
    if mode == "MASK":
        draft.factors["alpha_cutoff"] = max(draft.entry.number("alphaCutoff", 0.5), 0.0)
    return False


def _add_normal(draft: Draft) -> None:
    """Section 3.9.3: `scale` multiplies x and y."""
    texels = draft.texels(draft.entry, "normalTexture")
    if texels is not None:
        texels, said = mended_normals(texels, "normalTexture")
        draft.left_out += said
    if texels is not None:
        scale = draft.entry.entry("normalTexture").number("scale", 1)
        draft.maps["normal"] = np.concatenate([0.5 + (texels[..., :2] - 0.5) * scale, texels[..., 2:3]], axis=2)
    if draft.entry.has("occlusionTexture"):
        draft.left_out.append("occlusionTexture (light that is baked in)")
