"""KHR_materials_pbrSpecularGlossiness -> metallic-roughness, by texel."""

import numpy as np

from dataset_builder.assets.image_maps import resized
from dataset_builder.assets.readers.gltf_draft import Draft
from dataset_builder.assets.readers.gltf_values import Entry
from dataset_builder.assets.readers.specular_workflow import metallic_roughness

SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"


def from_specular_glossiness(draft: Draft, found: Entry) -> tuple[float, np.ndarray | None]:
    """Put the converted factors or maps into the draft. Returns the diffuse colour's coverage, factor and map."""
    factor = found.numbers("diffuseFactor", (1, 1, 1, 1)).clip(0, 1)
    specular = np.array(draft.colour(found, "specularFactor", (1.0, 1.0, 1.0)))
    glossiness = draft.share(found, "glossinessFactor", 1)
    diffuse = draft.texels(found, "diffuseTexture", srgb=True)
    surface = draft.texels(found, "specularGlossinessTexture", srgb=True)
    draft.left_out.append("specular-glossiness, converted to metallic-roughness")
    both = [np.ones((1, 1, 4), np.float32) if texels is None else texels for texels in (diffuse, surface)]
    height, width, _ = max((texels.shape for texels in both), key=lambda shape: shape[0] * shape[1])
    diffuse_texels, surface_texels = (resized(texels, (width, height)).astype(np.float64) for texels in both)
    base_color, metallic = metallic_roughness(diffuse_texels[..., :3] * factor[:3], surface_texels[..., :3] * specular)
    roughness = 1 - surface_texels[..., 3] * glossiness
    if diffuse is None and surface is None:
        red, green, blue = base_color[0, 0].tolist()
        draft.factors |= {"base_color": (red, green, blue), "metallic": float(metallic[0, 0]),
                          "roughness": float(roughness[0, 0])}
    else:
        draft.factors |= {"base_color": (1.0, 1.0, 1.0), "metallic": 1.0, "roughness": 1.0}
        draft.maps |= {"base_color": base_color, "metallic": metallic, "roughness": roughness}
    return float(factor[3]), None if diffuse is None else diffuse[..., 3]
