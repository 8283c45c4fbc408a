"""Material extensions of glTF: transmission, volume, index of refraction, dispersion, clear coat, sheen, specular,
emission, unlit.

https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos
"""

import numpy as np

from dataset_builder.assets.asset import reflectance_at
from dataset_builder.assets.readers.gltf_draft import Draft
from dataset_builder.assets.readers.gltf_values import Entry
from dataset_builder.spec.scene import MAX_SPECULAR

PREFIX = "KHR_materials_"
TAKEN = ("transmission", "volume", "ior", "dispersion", "clearcoat", "sheen", "specular", "emissive_strength", "unlit",
         "pbrSpecularGlossiness")
OFF = {"anisotropy": "anisotropyStrength", "iridescence": "iridescenceFactor",
       "diffuse_transmission": "diffuseTransmissionFactor"}
"""Extensions that are not taken, and the factor without which they say nothing."""
ABBE_OF_ONE = 20.0
"""KHR_materials_dispersion: its factor is this over the Abbe number."""
MIN_SHEEN_ROUGHNESS = 0.05
WHITE = (1.0, 1.0, 1.0)


def add_extensions(draft: Draft) -> None:
    """Add to a draft with its core what the extensions of its material say, and its emission. Raises UserError."""
    for step in (_dielectric, _transmitting, _coated, _with_sheen, _emitting, _name_others):
        step(draft)


def make_unlit(draft: Draft) -> None:
    """KHR_materials_unlit: the base colour is what is sent out, and nothing is reflected. The rest means nothing."""
    colour = draft.factors["base_color"]
    texels = draft.maps.get("base_color")
    kept = {key: value for key, value in draft.factors.items() if key.startswith("alpha")}
    draft.factors = {"base_color": (0.0, 0.0, 0.0), "roughness": 1.0, "specular": 0.0, "emission": colour, **kept}
    draft.maps = {key: value for key, value in draft.maps.items() if key == "alpha"}
    if texels is not None:
        draft.maps["emission"] = texels


def _extension(draft: Draft, name: str) -> Entry | None:
    return draft.entry.extension(PREFIX + name)


def _channel(draft: Draft, place: Entry, key: str, channel: int, target: str) -> None:
    """One channel of a texture as the map of a factor."""
    if (texels := draft.texels(place, key)) is not None:
        draft.maps[target] = texels[..., channel]


def _dielectric(draft: Draft) -> None:
    """KHR_materials_ior and _specular: reflectance ((n - 1) / (n + 1))^2 times a factor."""
    index, gloss = _extension(draft, "ior"), _extension(draft, "specular")
    ior = 1.5 if index is None else index.number("ior", 1.5)
    if index is not None:
        draft.factors["ior"] = min(max(ior, 1.0), 3.0)
        if ior not in (0.0, draft.factors["ior"]):
            draft.left_out.append(f"ior {ior:g}, taken as {draft.factors['ior']:g}")
    share = 1.0 if gloss is None else draft.share(gloss, "specularFactor", 1)
    if index is not None or gloss is not None:
        # An index of 0 stands for a reflectance of 1
        reflectance = (1.0 if ior == 0 else reflectance_at(draft.factors.get("ior", 1.5))) * share
        draft.factors["specular"] = min(reflectance, MAX_SPECULAR)
        if reflectance > MAX_SPECULAR:
            draft.left_out.append(f"a reflectance of {reflectance:.3g}, taken as {MAX_SPECULAR}")
    if gloss is not None:
        _channel(draft, gloss, "specularTexture", 3, "specular")
        tinted = gloss.has("specularColorTexture") or gloss.numbers("specularColorFactor", WHITE).tolist() != [1, 1, 1]
        if tinted:
            draft.left_out.append("the specular colour")


def _transmitting(draft: Draft) -> None:
    """KHR_materials_transmission; with a _volume of some thickness it is solid, and without one a thin sheet."""
    found = _extension(draft, "transmission")
    share = 0.0 if found is None else draft.share(found, "transmissionFactor", 0)
    if found is None or not share:
        return
    _channel(draft, found, "transmissionTexture", 0, "transmission")
    volume, dispersing = _extension(draft, "volume"), _extension(draft, "dispersion")
    thickness = 0.0 if volume is None else max(volume.number("thicknessFactor", 0), 0.0)
    dispersion = 0.0 if dispersing is None else draft.share(dispersing, "dispersion", 0, high=ABBE_OF_ONE)
    draft.factors |= {"transmission": share, "thin": not thickness,
                      "abbe": ABBE_OF_ONE / dispersion if thickness and dispersion else 0.0}
    if volume is not None and thickness:
        _tint(draft, volume, thickness)


def _tint(draft: Draft, volume: Entry, thickness: float) -> None:
    """KHR_materials_volume: attenuationColor ^ (distance / attenuationDistance), at the thickness that is stated."""
    texels = draft.texels(volume, "thicknessTexture")
    if texels is not None:
        thickness *= float(texels[..., 1].mean(dtype=np.float64))
        draft.left_out.append("thicknessTexture: its mean instead")
    colour = np.clip(draft.colour(volume, "attenuationColor", WHITE), 1e-6, 1)
    distance = volume.number("attenuationDistance", 0) if volume.has("attenuationDistance") else np.inf
    tint = colour ** (thickness / max(distance, 1e-9))
    if not np.allclose(tint, 1):
        red, green, blue = (np.array(draft.factors["base_color"]) * tint).tolist()
        draft.factors["base_color"] = (red, green, blue)
        draft.left_out.append("absorption in the body, taken as a tint for its stated thickness")


def _coated(draft: Draft) -> None:
    """KHR_materials_clearcoat."""
    found = _extension(draft, "clearcoat")
    share = 0.0 if found is None else draft.share(found, "clearcoatFactor", 0)
    if found is None or not share:
        return
    draft.factors |= {"coat": share, "coat_roughness": draft.share(found, "clearcoatRoughnessFactor", 0)}
    _channel(draft, found, "clearcoatTexture", 0, "coat")
    _channel(draft, found, "clearcoatRoughnessTexture", 1, "coat_roughness")
    if found.has("clearcoatNormalTexture"):
        draft.left_out.append("clearcoatNormalTexture")


def _with_sheen(draft: Draft) -> None:
    """KHR_materials_sheen."""
    found = _extension(draft, "sheen")
    colour = (0.0, 0.0, 0.0) if found is None else draft.colour(found, "sheenColorFactor", (0.0, 0.0, 0.0))
    if found is None or not any(colour):
        return
    roughness = draft.share(found, "sheenRoughnessFactor", 0)
    draft.factors |= {"sheen": colour, "sheen_roughness": max(roughness, MIN_SHEEN_ROUGHNESS)}
    if (texels := draft.texels(found, "sheenColorTexture", srgb=True)) is not None:
        draft.maps["sheen"] = texels[..., :3]
    _channel(draft, found, "sheenRoughnessTexture", 3, "sheen_roughness")


def _emitting(draft: Draft) -> None:
    """Section 3.9.5 and KHR_materials_emissive_strength."""
    strength = _extension(draft, "emissive_strength")
    colour = np.array(draft.colour(draft.entry, "emissiveFactor", (0.0, 0.0, 0.0), high=np.inf))
    if strength is not None:
        colour = colour * draft.share(strength, "emissiveStrength", 1, high=np.inf)
    if colour.any():
        red, green, blue = colour.tolist()
        draft.factors["emission"] = (red, green, blue)
        if (texels := draft.texels(draft.entry, "emissiveTexture", srgb=True)) is not None:
            draft.maps["emission"] = texels[..., :3]


def _name_others(draft: Draft) -> None:
    """Extensions that are not taken, unless a factor of 0 switches them off."""
    for key in draft.entry.entry("extensions").value:
        name = key.removeprefix(PREFIX)
        found = draft.entry.entry("extensions").entry(key)
        if name not in TAKEN and (name not in OFF or found.number(OFF[name], 0)):
            draft.left_out.append(key)
