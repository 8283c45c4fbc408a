"""Materials of MTL libraries -> FileMaterial.

The words are those of Alias/Wavefront's MTL format (illumination models included) and of its PBR extension: Pr, Pm, Ps,
Pc, Pcr, Ke, norm (http://exocortex.com/blog/extending_wavefront_mtl_to_support_pbr). docs/readers.md has the table.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from dataset_builder.assets.asset import Material, reflectance_at
from dataset_builder.assets.file_model import ROUGHNESS, FileMaterial, refuse
from dataset_builder.assets.readers.mtl_maps import MtlMaps, mtl_maps
from dataset_builder.assets.readers.specular_workflow import DIELECTRIC, metallic_roughness
from dataset_builder.digest import digest, sha256_file
from dataset_builder.spec.file_reference import MOST_BYTES
from dataset_builder.spec.obj_references import READ_MAPS, entry_maps
from dataset_builder.spec.scene import MAX_SPECULAR
from dataset_builder.spec.wavefront import MtlEntry, Statement, uncommented

BRIGHTEST = 1e6
"""Of Ke: more than any lamp."""
KD = 0.8
"""Of a material without Kd and map_Kd, as in Blender."""
FLAT, MIRRORS, SOLID_GLASS, THIN_GLASS = (0, 1), (3, 5, 8), (6, 7), (4, 9)
"""Illumination models without highlights, with reflections, and of glass that bends light or does not."""
PLAIN = frozenset({"illum", "ka"})
"""Read elsewhere, or without a meaning here: there is no ambient light beside the sky's."""
NEUTRAL = {"tf": (0.0, 1.0), "aniso": (0.0,), "anisor": (0.0,)}
"""Values that change nothing; beside Pr and Pm, Blender means transmission by a Tf of 1."""
Triple = tuple[float, float, float]


class _Words:
    """What a library says of a material; numbers that are asked for count as read."""

    def __init__(self, entry: MtlEntry):
        self.entry = entry
        self.said: dict[str, Statement] = {said.key.lower(): said for said in entry.statements}
        self.read: set[str] = set()
        times = Counter(said.key.lower() for said in entry.statements)
        self.left_out = [f"all but the last {self.said[key].key}" for key, count in times.items() if count > 1]

    def numbers(self, key: str) -> list[float] | None:
        """The numbers after a key, None where it is not there. Raises UserError for what are none."""
        statement = self.said.get(key)
        if statement is None:
            return None
        self.read.add(key)
        words = [word for word in uncommented(statement.rest).split() if word != "-halo"]
        if len(words) < len(uncommented(statement.rest).split()):
            self.left_out.append(f"-halo of {statement.key}")
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = []
        if not values or not np.isfinite(values).all():
            refuse(self.entry.library, f"expected numbers after {statement.key}, got {statement.rest[:40]!r}",
                   at=f"line {statement.line}")
        return values

    def number(self, key: str, low: float = 0.0, high: float = 1.0) -> float | None:
        """One number, clipped; that it was is named."""
        values = self.numbers(key)
        return None if values is None else self._clipped(key, values[:1], low, high)[0]

    def color(self, key: str, high: float = 1.0) -> Triple | None:
        """One number for all channels, or three. None for a spectrum, too, which is named."""
        statement = self.said.get(key)
        if statement is not None and statement.rest.split()[:1] in (["spectral"], ["xyz"]):
            self.read.add(key)
            self.left_out.append(f"{statement.key} as {statement.rest.split()[0]}")
            return None
        values = self.numbers(key)
        if values is None or statement is None:
            return None
        if len(values) not in (1, 3):
            refuse(self.entry.library, f"expected 1 or 3 numbers after {statement.key}, got {len(values)}",
                   at=f"line {statement.line}")
        red, green, blue = self._clipped(key, values if len(values) == 3 else values * 3, 0.0, high)
        return red, green, blue

    def _clipped(self, key: str, values: list[float], low: float, high: float) -> list[float]:
        inside = [min(max(value, low), high) for value in values]
        if inside != values:
            self.left_out.append(f"{self.said[key].key} beyond {low:g} to {high:g}")
        return inside

    def unread(self) -> list[str]:
        """Keys that nothing asked for."""
        return [statement.key for key, statement in self.said.items()
                if key not in self.read and key not in PLAIN and not self._neutral(key)
                and not (key in READ_MAPS and statement.rest)]

    def _neutral(self, key: str) -> bool:
        values = self.numbers(key) if key in NEUTRAL and not self.said[key].rest.startswith(("s", "x")) else None
        if key == "tf" and {"pr", "pm"} & set(self.said):
            return values is not None and not any(values)
        return values is not None and any(set(values) == {neutral} for neutral in NEUTRAL[key])


def file_material(entry: MtlEntry, mesh: Path, max_texture: int) -> FileMaterial:
    """A material with its maps, which lie in the folder of `mesh`; `max_texture`: their longest side in texels."""
    words = _Words(entry)
    model = int(words.number("illum", 0, 10) or 0) if "illum" in words.said else -1
    glass = model in SOLID_GLASS or (model in THIN_GLASS and _opaque(words) < 1)
    maps = mtl_maps(entry, mesh, max_texture, without=("alpha",) if glass else ())
    made = _layers(_surface(words, maps, model), words, maps)
    made = _glass(made, words, model) if glass else replace(made, alpha=_opaque(words))
    made = replace(made, texture=maps.texture)
    images = [(each.key, sha256_file(mesh.parent / name, most=MOST_BYTES)) for each, name in entry_maps(mesh, entry)]
    said = [[each.key, each.rest] for each in entry.statements if each.key.lower() not in READ_MAPS]
    return FileMaterial(material=made, uv_transform=maps.uv_transform, content=digest([said, images]),
                        left_out=tuple(dict.fromkeys([*words.left_out, *words.unread(), *maps.left_out,
                                                      *_unseen(made, words)])))


def _surface(words: _Words, maps: MtlMaps, model: int) -> Material:
    """What scatters: Kd, Ks with Ns and Ni, Pr and Pm."""
    said = words.color("kd")
    kd: Triple = said if said is not None else (1.0,) * 3 if "base_color" in maps.names else (KD,) * 3
    roughness, metallic = words.number("pr"), words.number("pm")
    exponent, ks, index = words.number("ns", 0, 1e9), words.color("ks"), words.number("ni", 0, 10)
    physical = bool({"pr", "pm"} & set(words.said) or {"roughness", "metallic"} & maps.names)
    if roughness is None:
        roughness = _width(exponent) if exponent is not None else ROUGHNESS
        roughness = 1.0 if "roughness" in maps.names else 0.0 if model in MIRRORS and exponent is None else roughness
    made = Material(name=words.entry.name, base_color=kd, roughness=roughness,
                    metallic=metallic if metallic is not None else float("metallic" in maps.names),
                    specular=0.0 if model in FLAT and not physical else _specular(index, ks, maps))
    if model not in MIRRORS or ks is None or physical or "specular" in maps.names:
        if ks is not None and max(ks) - min(ks) > 1e-3:
            words.left_out.append("the colour of Ks")
        return made
    if "base_color" in maps.names:
        words.left_out.append(f"illum {model} texel by texel: map_Kd tints what is reflected, too")
    return _mirror(made, ks)


def _width(exponent: float) -> float:
    """Roughness of the lobe as wide as a Blinn-Phong one: alpha = sqrt(2 / (Ns + 2)), and roughness is its root
    (B. Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007)."""
    return float((2 / (exponent + 2)) ** 0.25)


def _specular(index: float | None, ks: Triple | None, maps: MtlMaps) -> float:
    """Reflectance at normal incidence: that of Ni, 1.5 unless it is above 1, times twice the mean of Ks, so that Ks 0.5
    is what Ni says, as Blender writes and reads it."""
    weight = 2 * (float(np.mean(ks)) if ks is not None else 1.0 if "specular" in maps.names else 0.5)
    return min(weight * (reflectance_at(index) if index is not None and index > 1 else 0.04), MAX_SPECULAR)


def _mirror(material: Material, ks: Triple) -> Material:
    """Models 3, 5 and 8 reflect with Ks as it stands, and scatter Kd."""
    base_color, metallic = metallic_roughness(np.array(material.base_color), np.array(ks))
    red, green, blue = base_color.tolist()
    return replace(material, base_color=(red, green, blue), metallic=float(metallic), specular=DIELECTRIC)


def _layers(material: Material, words: _Words, maps: MtlMaps) -> Material:
    """Emission, sheen and clear coat; a map without its factor is taken as it is."""
    def factor(key: str, channel: str, get: Callable[[str], float | None] = words.number) -> float:
        said = get(key)
        return said if said is not None else float(channel in maps.names)

    emitted, sheen = words.color("ke", BRIGHTEST), factor("ps", "sheen")
    return replace(material, coat=factor("pc", "coat"), coat_roughness=factor("pcr", "coat_roughness"),
                   sheen=(sheen,) * 3,
                   emission=emitted if emitted is not None else (float("emission" in maps.names),) * 3)


def _opaque(words: _Words) -> float:
    """d, or else 1 - Tr."""
    dissolved, transparent = words.number("d"), words.number("tr")
    if dissolved is not None and transparent is not None and abs(1 - transparent - dissolved) > 1e-3:
        words.left_out.append(f"Tr, which contradicts d {dissolved:g}")
    return dissolved if dissolved is not None else 1.0 if transparent is None else 1 - transparent


def _glass(material: Material, words: _Words, model: int) -> Material:
    """d (or 1 - Tr) is what stays opaque; glass that refracts is often written with a d of 1, which then means nothing.
    Tf, or a Kd that is not black, tints; Ni is the index of refraction."""
    index = words.number("ni", 1, 3)
    index = 1.5 if index is None else index
    kd = words.color("kd")
    tint = words.color("tf") or (kd if kd and any(kd) else (1.0, 1.0, 1.0))
    return replace(material, transmission=1 - _opaque(words) % 1, thin=model in THIN_GLASS, ior=index, base_color=tint,
                   specular=min(reflectance_at(index), MAX_SPECULAR), metallic=0.0,
                   roughness=material.roughness if {"ns", "pr"} & set(words.said) else 0.0)


def _unseen(material: Material, words: _Words) -> list[str]:
    """Surfaces that send nothing back, or are not there: seldom what is meant."""
    texture, found = material.texture, []
    color = material.base_color if texture is None else texture.base_color.reshape(-1, 3) * material.base_color
    if np.max(color) == 0 and not (any(material.emission) or material.transmission or material.coat):
        kd = words.said.get("kd")
        found.append(f"all black{f' by its Kd {kd.rest}' if kd else ''}{' under map_Kd' if texture else ''}")
    if material.alpha == 0:
        found.append("invisible")
    return [f"{each}, as the file says" for each in found]
