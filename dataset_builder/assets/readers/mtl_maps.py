"""Texture maps of MTL libraries -> Texture."""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dataset_builder.assets.asset import Texture, Wrap
from dataset_builder.assets.file_model import refuse
from dataset_builder.assets.image_maps import ImageFile, make_texture, read_texels
from dataset_builder.assets.normal_maps import mended_normals
from dataset_builder.spec.obj_references import READ_MAPS, entry_maps
from dataset_builder.spec.wavefront import MapWords, MtlEntry, Statement, map_words

COLORS = ("base_color", "emission", "specular")
"""Images of encoded colours; of the others the values count."""
WORDLESS = {"blendu": "on", "blendv": "on", "cc": "off"}
"""Options that change nothing with these values."""
TAKEN = ("s", "o", "clamp", "bm", "imfchan")
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
Placement = tuple[tuple[float, ...], bool]
"""Scale and offset along u and v, and whether the edge is clamped."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MtlMaps:
    """The maps of a material."""

    texture: Texture | None
    names: frozenset[str]
    """Which of the texture's maps the library names."""
    uv_transform: np.ndarray | None
    left_out: tuple[str, ...]


def mtl_maps(entry: MtlEntry, mesh: Path, max_texture: int, *, without: Collection[str] = ()) -> MtlMaps:
    """All maps that are read, but those `without`. They have to lie alike: one that lies otherwise than map_Kd, or than
    the first, is left out and named. Raises UserError for images that cannot be read."""
    left_out: list[str] = []
    named: dict[str, tuple[Statement, str]] = {}
    try:
        listed = entry_maps(mesh, entry)
    except ValueError as error:
        refuse(mesh, f"expected a readable library, got: {error}")
    for said, name in listed:
        channel = READ_MAPS[said.key.lower()]
        if channel in without:
            left_out.append(said.key)
        else:
            named[channel] = said, name
    if "normal" in named and "bump" in named:
        left_out.append(named.pop("bump")[0].key)
    found: dict[str, np.ndarray] = {}
    placement: Placement | None = None
    for channel in sorted(named, key=lambda channel: channel != "base_color"):
        said, name = named[channel]
        words = map_words(said.rest)
        here = _placement(entry, said, words)
        if placement not in (None, here):
            left_out.append(f"{said.key}, whose -s, -o or -clamp differ from those of other maps")
            continue
        image = ImageFile(name=str(mesh.parent / name), content=mesh.parent / name)
        texels = read_texels(image, srgb=channel in COLORS, max_size=max_texture)
        if channel in ("normal", "bump"):
            if channel == "bump" and not _has_normals(texels):
                left_out.append(f"{said.key}, a map of heights")
                continue
            normals, faults = mended_normals(texels[..., :3], said.key)
            left_out += faults
            if normals is None:
                continue
            found["normal"] = _scaled_normals(normals, _number(entry, said, words, "bm"))
        elif channel == "base_color":
            found[channel] = texels[..., :3]
            if texels[..., 3].min() < 1 and "alpha" not in named and "alpha" not in without:
                left_out.append(f"coverage in the image of {said.key}, which no map_d names")
        else:
            found[channel] = _values(texels, channel, words)
        placement = here
        left_out += [f"-{option} of {said.key}" for option, values in words.options.items()
                     if option not in TAKEN and not _wordless(option, values)]
    scale_u, scale_v, offset_u, offset_v, clamped = (1.0, 1.0, 0.0, 0.0, False) if placement is None else (
        *placement[0], placement[1])
    matrix = np.array([[scale_u, 0, offset_u], [0, scale_v, offset_v]])
    wrap: Wrap = "clamp" if clamped else "repeat"
    return MtlMaps(texture=make_texture(found, wrap=(wrap, wrap)), names=frozenset(found), left_out=tuple(left_out),
                   uv_transform=None if np.array_equal(matrix, np.eye(3)[:2]) else matrix)


def _wordless(option: str, values: tuple[str, ...]) -> bool:
    """Whether an option changes nothing."""
    if option in ("mm", "t"):
        neutral = ("0", "1") if option == "mm" else ("0", "0", "0")
        return all(_float(value) == float(default) for value, default in zip(values, neutral, strict=False))
    return [WORDLESS.get(option)] == [value.lower() for value in values]


def _float(word: str) -> float:
    """A number of a sensible size; NaN of anything else."""
    try:
        return float(word) if abs(float(word)) < 1e9 else np.nan
    except ValueError:
        return np.nan


def _placement(entry: MtlEntry, said: Statement, words: MapWords) -> Placement:
    values = {}
    for option, default in (("s", 1.0), ("o", 0.0)):
        numbers = [_float(word) for word in words.options.get(option, ())]
        if not np.isfinite(numbers).all():
            refuse(entry.library, f"expected numbers after -{option}, got {' '.join(words.options[option])[:40]!r}",
                   at=f"line {said.line}")
        values[option] = (*numbers, default, default)[:2]
    return (*values["s"], *values["o"]), words.options.get("clamp", ("off",))[0].lower() == "on"


def _number(entry: MtlEntry, said: Statement, words: MapWords, option: str) -> float:
    value = _float(words.options.get(option, ("1",))[0])
    if not np.isfinite(value):
        refuse(entry.library, f"expected a number after -{option}, got {words.options[option][0][:40]!r}",
               at=f"line {said.line}")
    return value


def _values(texels: np.ndarray, channel: str, words: MapWords) -> np.ndarray:
    """(H, W), or (H, W, 3) of emission and sheen: of the channel that -imfchan names, or else luminance; coverage from
    that of the image where it has some."""
    chosen = words.options.get("imfchan", ("",))[0].lower()
    if channel == "emission":
        return texels[..., :3]
    if chosen in ("r", "g", "b"):
        values = texels[..., "rgb".index(chosen)]
    elif chosen == "m" or (channel == "alpha" and not chosen and texels[..., 3].min() < 1):
        values = texels[..., 3]
    else:
        values = texels[..., :3] @ LUMINANCE
    return np.repeat(values[..., None], 3, axis=2) if channel == "sheen" else values


def _has_normals(texels: np.ndarray) -> bool:
    """Whether an image holds unit vectors that mostly point outwards, rather than heights."""
    vectors = 2 * texels[..., :3] - 1
    units = np.abs(np.linalg.norm(vectors, axis=2) - 1) < 0.15
    return bool(units.mean() > 0.9 and vectors[..., 2].mean() > 0.6)


def _scaled_normals(texels: np.ndarray, scale: float) -> np.ndarray:
    """Encoded normals with x and y times `scale`."""
    vectors = (2 * texels - 1) * (scale, scale, 1)
    return vectors / np.maximum(np.linalg.norm(vectors, axis=2, keepdims=True), 1e-6) / 2 + 0.5
