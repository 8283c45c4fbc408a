"""Material extensions of glTF: transmission, volume, index of refraction, dispersion, clear coat, sheen, specular.

Their factors are taken, their textures are not. https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dataset_builder.assets.asset import Material, reflectance_at
from dataset_builder.errors import Problem, UserError
from dataset_builder.spec.gltf_references import gltf_header
from dataset_builder.spec.scene import MAX_SPECULAR

PREFIX = "KHR_materials_"
TAKEN = ("transmission", "volume", "ior", "dispersion", "clearcoat", "sheen", "specular")
ABBE_OF_ONE = 20.0
"""KHR_materials_dispersion: its factor is this over the Abbe number."""
MIN_SHEEN_ROUGHNESS = 0.05

Entry = Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class Extended:
    """A material with its extensions."""

    material: Material
    left_out: tuple[str, ...]
    """What of them could not be taken, in words."""


def material_entries(path: Path) -> dict[str | None, dict[str, Any]]:
    """Every material of a glTF file as it stands there, by its name or lack of one; empty for other files.

    Materials that share a name must share their extensions, too, since the reader tells them apart by nothing else.
    Raises UserError where they do not.
    """
    if path.suffix.lower() not in (".glb", ".gltf"):
        return {}
    entries: dict[str | None, dict[str, Any]] = {}
    for entry in gltf_header(path).get("materials", []):
        first = entries.setdefault(entry.get("name"), entry)
        if first.get("extensions", {}) != entry.get("extensions", {}):
            called = f"{entry['name']!r}" if entry.get("name") else "no name"
            raise UserError([Problem(where=str(path), path="materials", hint="give each material a unique name",
                                     rule=f"expected materials with the same name to be equal, got two of {called} "
                                          "with different extensions")])
    return entries


def extended(material: Material, entry: Entry) -> Extended:
    """The material with what the extensions of its glTF `entry` say."""
    found = {key.removeprefix(PREFIX): value for key, value in entry.get("extensions", {}).items()
             if key.startswith(PREFIX)}
    made = _coated(_transmitting(_dielectric(material, found), found), found)
    return Extended(material=made, left_out=(*_unknown(entry), *_textures(found), *_attenuated(found)))


def _factor(found: Entry, extension: str, key: str, default: float, low: float = 0.0, high: float = 1.0) -> float:
    return float(np.clip(found.get(extension, {}).get(key, default), low, high))


def _dielectric(material: Material, found: Entry) -> Material:
    """KHR_materials_ior and _specular: reflectance ((n - 1) / (n + 1))^2 times a factor."""
    if not {"ior", "specular"} & set(found):
        return material
    ior = max(_factor(found, "ior", "ior", 1.5, 0.0, 3.0), 1.0)
    specular = reflectance_at(ior) * _factor(found, "specular", "specularFactor", 1.0)
    return replace(material, ior=ior, specular=min(specular, MAX_SPECULAR))


def _transmitting(material: Material, found: Entry) -> Material:
    """KHR_materials_transmission; with a _volume of some thickness it is solid, and without one a thin sheet."""
    share = _factor(found, "transmission", "transmissionFactor", 0.0)
    if not share:
        return material
    thick = _thickness(found) > 0
    dispersion = _factor(found, "dispersion", "dispersion", 0.0, 0.0, ABBE_OF_ONE)
    tint = _tint(found)
    red, green, blue = (float(base * share_left) for base, share_left in zip(material.base_color, tint, strict=True))
    return replace(material, transmission=share, thin=not thick, base_color=(red, green, blue),
                   abbe=ABBE_OF_ONE / dispersion if thick and dispersion else 0.0)


def _thickness(found: Entry) -> float:
    return _factor(found, "volume", "thicknessFactor", 0.0, 0.0, np.inf)


def _tint(found: Entry) -> np.ndarray:
    """(3,) what light loses on its way through a body of the thickness that the file states.

    KHR_materials_volume: attenuationColor ^ (distance / attenuationDistance).
    """
    distance = _factor(found, "volume", "attenuationDistance", np.inf, 1e-9, np.inf)
    colour = np.clip(found.get("volume", {}).get("attenuationColor", (1.0, 1.0, 1.0)), 1e-6, 1)
    return np.asarray(colour, dtype=float) ** (_thickness(found) / distance)


def _coated(material: Material, found: Entry) -> Material:
    """KHR_materials_clearcoat and _sheen."""
    red, green, blue = np.clip(found.get("sheen", {}).get("sheenColorFactor", (0.0, 0.0, 0.0)), 0, 1).tolist()
    return replace(material, coat=_factor(found, "clearcoat", "clearcoatFactor", 0.0),
                   coat_roughness=_factor(found, "clearcoat", "clearcoatRoughnessFactor", 0.0),
                   sheen=(red, green, blue),
                   sheen_roughness=_factor(found, "sheen", "sheenRoughnessFactor", 0.0, MIN_SHEEN_ROUGHNESS)
                   if "sheen" in found else material.sheen_roughness)


# What is not taken

def _unknown(entry: Entry) -> list[str]:
    """Extensions that are not known here, and emission."""
    lost = [key for key in entry.get("extensions", {}) if key.removeprefix(PREFIX) not in TAKEN]
    return [*lost, *(["emission"] if any(entry.get("emissiveFactor", (0, 0, 0))) else [])]


def _textures(found: Entry) -> list[str]:
    return [f"{PREFIX}{name}.{key}" for name in TAKEN for key in found.get(name, {}) if key.endswith("Texture")]


def _attenuated(found: Entry) -> list[str]:
    tinted = found.get("transmission") and not np.allclose(_tint(found), 1)
    return ["absorption in the body, taken as a tint for its stated thickness"] if tinted else []
