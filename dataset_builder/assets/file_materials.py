"""Materials of a mesh file -> Material, with textures: glTF's metallic-roughness, OBJ's MTL, or vertex colours."""

from dataclasses import replace
from typing import Any

import numpy as np
from PIL import Image

from dataset_builder.assets.asset import Material, Texture, reflectance_at
from dataset_builder.errors import UserError
from dataset_builder.spec.scene import MAX_SPECULAR

ROUGHNESS = 0.8
"""Where a file says nothing about it."""
GREY = 0.6
SOLID_GLASS, THIN_GLASS = (6, 7), (4, 9)
"""Illumination models (`illum`) of MTL."""
TEXTURES = ("baseColorTexture", "metallicRoughnessTexture")


def linear_from_srgb(values: np.ndarray) -> np.ndarray:
    """Linear light in [0, 1] of sRGB-encoded values in [0, 1] (IEC 61966-2-1)."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def make_texture(*, base_color: Image.Image | None, metallic_roughness: Image.Image | None = None,
                 normal: Image.Image | None = None, max_size: int = 1024) -> Texture | None:
    """Texture of glTF's images: sRGB base colour, metallic (blue) and roughness (green), tangent-space normals.

    Every map takes the size of the base colour, or of the first map there is, scaled down as a whole where a side
    exceeds `max_size` texels. None where there is no image. Alpha is not used.
    """
    images = [image for image in (base_color, metallic_roughness, normal) if image is not None]
    if not images:
        return None
    size = limited_size(images[0].size, max_size)
    color = np.ones((size[1], size[0], 3)) if base_color is None else linear_from_srgb(_texels(base_color))
    surface = None if metallic_roughness is None else resized(_texels(metallic_roughness), size)
    return Texture(
        base_color=_unit_range(resized(color, size)),
        roughness=None if surface is None else _unit_range(surface[..., 1]),
        metallic=None if surface is None else _unit_range(surface[..., 2]),
        normal=None if normal is None else _unit_vectors(resized(2 * _texels(normal) - 1, size)),
    )


def limited_size(size: tuple[int, int], max_size: int) -> tuple[int, int]:
    """(width, height) scaled down to sides of at most `max_size`, proportions kept, never below one texel."""
    factor = min(1.0, max_size / max(size))
    return max(1, round(size[0] * factor)), max(1, round(size[1] * factor))


def resized(texels: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(H, W, C) texels at (width, height) `size`: area means where it shrinks, bilinear where it grows; in linear
    values."""
    if (texels.shape[1], texels.shape[0]) == size:
        return texels
    grows = size[0] > texels.shape[1] or size[1] > texels.shape[0]
    method = Image.Resampling.BILINEAR if grows else Image.Resampling.BOX
    channels = [np.asarray(Image.fromarray(channel.astype(np.float32)).resize(size, method))
                for channel in np.moveaxis(texels, 2, 0)]
    return np.stack(channels, axis=2)


def _texels(image: Image.Image) -> np.ndarray:
    """(H, W, 3) float64 in [0, 1]; a single channel fills all three, 16 bits are kept."""
    if image.mode.startswith(("I", "F")):
        return np.repeat(np.asarray(image, dtype=np.float64)[..., None] / 65535, 3, axis=2)
    return np.asarray(image.convert("RGB"), dtype=np.float64) / 255


def _unit_range(texels: np.ndarray) -> np.ndarray:
    return np.clip(texels, 0, 1).astype(np.float32)


def _unit_vectors(texels: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(texels, axis=2, keepdims=True)
    upright = np.broadcast_to((0.0, 0.0, 1.0), texels.shape)
    return np.where(length > 1e-6, texels / np.maximum(length, 1e-6), upright).astype(np.float32)


def file_material(visual: Any, *, name: str, factors: dict[str, Any], max_texture: int) -> Material:
    """Material of a mesh's `visual` as trimesh gives it.

    factors: glTF's own numbers of this material where known; trimesh rounds colours to 8 bits. max_texture: texels.
    """
    material = getattr(visual, "material", None)
    if hasattr(material, "metallicFactor"):
        return _metallic_roughness(material, name, factors, max_texture)
    if hasattr(material, "kwargs"):
        return _wavefront(material, name, max_texture)
    return Material(name=name, base_color=_mean_color(visual), roughness=ROUGHNESS)


def _metallic_roughness(material: Any, name: str, factors: dict[str, Any], max_texture: int) -> Material:
    """glTF 2.0, section 3.9.2: factors are linear and default to 1."""
    lost = [key for key in TEXTURES if key in factors and getattr(material, key) is None]
    if lost:
        raise UserError(f"material {name}: {', '.join(lost)}: expected PNG or JPEG images, got something else")
    rounded = 1.0 if material.baseColorFactor is None else np.asarray(material.baseColorFactor) / 255
    color = factors.get("baseColorFactor", np.broadcast_to(rounded, 4))
    texture = make_texture(base_color=material.baseColorTexture, metallic_roughness=material.metallicRoughnessTexture,
                           normal=material.normalTexture, max_size=max_texture)
    return Material(name=name, base_color=_triple(color), texture=texture,
                    roughness=_share(1.0 if material.roughnessFactor is None else material.roughnessFactor),
                    metallic=_share(1.0 if material.metallicFactor is None else material.metallicFactor))


def _wavefront(material: Any, name: str, max_texture: int) -> Material:
    """MTL: Kd is linear; Ns is a Blinn-Phong exponent.

    The lobe of equal width has alpha = sqrt(2 / (Ns + 2)) (B. Walter et al., "Microfacet Models for Refraction through
    Rough Surfaces", EGSR 2007); roughness is the root of alpha.
    """
    extra = getattr(material, "kwargs", {}) or {}
    diffuse = getattr(material, "diffuse", None)
    color = extra.get("kd", (GREY,) * 3 if diffuse is None else np.asarray(diffuse) / 255)
    exponent = extra.get("ns")
    roughness = ROUGHNESS if exponent is None else (2 / (max(float(exponent), 0.0) + 2)) ** 0.25
    texture = make_texture(base_color=getattr(material, "image", None), max_size=max_texture)
    plain = Material(name=name, base_color=_triple(color), roughness=_share(roughness), texture=texture)
    return _wavefront_glass(plain, extra)


def _wavefront_glass(material: Material, extra: dict[str, Any]) -> Material:
    """MTL's illumination models of glass: 6 and 7 refract and are solid, 4 and 9 bend no light and are thin.

    d (or 1 - Tr) is what stays opaque; glass that refracts is often written with a d of 1, which then means nothing.
    Tf, or a Kd that is not black, tints; Ni is the index of refraction. Other models keep no transparency.
    """
    model = int(_number(extra, "illum", 0))
    if model not in (*SOLID_GLASS, *THIN_GLASS):
        return material
    opaque = _number(extra, "d", 1 - _number(extra, "tr", 0))
    if opaque >= 1 and model in THIN_GLASS:
        return material
    ior = float(np.clip(_number(extra, "ni", 1.5), 1, 3))
    tint = extra.get("tf") or (material.base_color if any(material.base_color) else (1.0, 1.0, 1.0))
    return replace(material, transmission=_share(1 - opaque % 1), thin=model in THIN_GLASS, ior=ior,
                   specular=min(reflectance_at(ior), MAX_SPECULAR),
                   base_color=_triple([float(value) for value in tint]),
                   roughness=material.roughness if "ns" in extra else 0.0)


def _number(extra: dict[str, Any], key: str, default: float) -> float:
    """A number of an MTL file, which the reader leaves as a list of words."""
    value = extra.get(key, default)
    return float(value[-1] if isinstance(value, list) else value)


def _mean_color(visual: Any) -> tuple[float, float, float]:
    """Linear mean of sRGB vertex or face colours; grey where there are none."""
    if getattr(visual, "kind", None) not in ("vertex", "face"):
        return (GREY,) * 3
    colors = visual.vertex_colors if visual.kind == "vertex" else visual.face_colors
    return _triple(linear_from_srgb(np.asarray(colors)[:, :3] / 255).mean(axis=0))


def _triple(color: Any) -> tuple[float, float, float]:
    red, green, blue = (_share(value) for value in np.atleast_1d(color)[:3])
    return red, green, blue


def _share(value: Any) -> float:
    return float(np.clip(value, 0, 1))
