"""UsdPreviewSurface -> FileMaterial: https://openusd.org/release/spec_usdpreviewsurface.html"""

import io
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dataset_builder.assets.asset import Material, Wrap, reflectance_at
from dataset_builder.assets.file_model import FileMaterial, refuse
from dataset_builder.assets.image_maps import ImageFile, holds_floats, make_texture, opened_image, read_texels
from dataset_builder.assets.normal_maps import mended_normals
from dataset_builder.digest import read_regular
from dataset_builder.spec.file_reference import MOST_BYTES, is_within
from dataset_builder.spec.scene import MAX_SPECULAR
from dataset_builder.spec.usd_references import UDIM

if TYPE_CHECKING:
    from pxr import UsdShade

WRAPS: dict[str, Wrap] = {"repeat": "repeat", "mirror": "mirror", "clamp": "clamp", "black": "clamp"}
CHANNELS = {"r": [0, 0, 0], "g": [1, 1, 1], "b": [2, 2, 2], "a": [3, 3, 3], "rgb": [0, 1, 2]}
DIFFUSE = 0.18
"""Of a surface whose diffuseColor is not written; its roughness is then 0.5."""
DECODED = ("RGB", "RGBA", "P", "CMYK", "YCbCr")
"""Modes of images that colour space `auto` takes for sRGB: 8 bits and three or more channels."""


@dataclass(frozen=True, kw_only=True, eq=False)
class UsdMaterial:
    """A material, and the primvars that it reads."""

    file: FileMaterial
    coordinates: str
    """Name of the texture coordinates."""
    colors: str
    """Name of the colours of vertices, empty if it reads none."""
    black: bool
    """Whether there is no texture, but black, beyond the edge of one."""


@dataclass(kw_only=True, eq=False)
class _Draft:
    path: Path
    shader: "UsdShade.Shader"
    max_texture: int
    folders: tuple[Path, ...]
    maps: dict[str, np.ndarray] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    layout: tuple[str, tuple[float, ...], str, str] | None = None
    """How the first texture lies: coordinates, the six numbers of their map, and what is beyond the edges."""
    colors: str = ""


def read_preview_surface(path: Path, shader: "UsdShade.Shader", name: str, max_texture: int,
                         folders: tuple[Path, ...]) -> UsdMaterial:
    """The material of a UsdPreviewSurface, whose textures lie in one of some folders. Raises UserError where a texture
    cannot be read."""
    draft = _Draft(path=path, shader=shader, max_texture=max_texture, folders=folders)
    base = _color(draft, "diffuseColor", "base_color", DIFFUSE)
    roughness, alpha = _number(draft, "roughness", "roughness", 0.5), _number(draft, "opacity", "alpha", 1.0)
    coat = _number(draft, "clearcoat", "coat", 0.0)
    coat_roughness = _number(draft, "clearcoatRoughness", "coat_roughness", 0.01)
    emission = _color(draft, "emissiveColor", "emission", 0.0)
    metallic, specular = _reflection(draft)
    cutoff = _constant(draft, "opacityThreshold", 0.0)
    if cutoff <= 0 and (alpha < 1 or "alpha" in draft.maps) and _input(shader, "opacityMode") != "presence":
        draft.left_out.append("opacity of mode transparent, taken as presence: its highlights go with it")
    _normal(draft)
    _name_the_rest(draft)
    names, matrix, wrap_s, wrap_t = draft.layout or ("st", (1.0, 0.0, 0.0, 0.0, 1.0, 0.0), "repeat", "repeat")
    material = Material(
        name=name, base_color=base, roughness=roughness, metallic=metallic, specular=specular, coat=coat,
        coat_roughness=coat_roughness, emission=emission, alpha=alpha, alpha_cutoff=cutoff if cutoff > 0 else None,
        texture=make_texture(draft.maps, wrap=(WRAPS.get(wrap_s, "repeat"), WRAPS.get(wrap_t, "repeat"))))
    made = FileMaterial(material=material, left_out=tuple(draft.left_out), uv_transform=np.reshape(matrix, (2, 3)))
    return UsdMaterial(file=made, coordinates=names, colors=draft.colors, black="black" in (wrap_s, wrap_t))


def _reflection(draft: _Draft) -> tuple[float, float]:
    """Metallic and specular: by index of refraction, or from a specular colour that dielectrics have."""
    ior = _constant(draft, "ior", 1.5)
    draft.left_out += [f"ior {ior:g}, taken as 1"] if ior < 1 else []
    from_ior = reflectance_at(max(1.0, ior))
    if not _constant(draft, "useSpecularWorkflow", 0):
        if from_ior > MAX_SPECULAR:
            draft.left_out.append(f"ior whose reflectance is {from_ior:.3g}, taken as {MAX_SPECULAR}")
        return _number(draft, "metallic", "metallic", 0.0), min(from_ior, MAX_SPECULAR)
    value, texture = _source(draft, "specularColor")
    color = np.array(value if texture is None and value is not None else (0.0,) * 3, dtype=float)
    if texture is not None or np.ptp(color) > 1e-6 or color.max() > MAX_SPECULAR:
        draft.left_out.append("specularColor, taken as a grey that dielectrics have")
    return 0.0, float(np.clip(color.mean(), 0, MAX_SPECULAR))


def _color(draft: _Draft, name: str, key: str, default: float) -> tuple[float, float, float]:
    """Factor of an input, (1, 1, 1) where a texture gives it, which goes into the maps."""
    value, texture = _source(draft, name)
    if texture is not None and texture[0].GetIdAttr().Get() == "UsdPrimvarReader_float3" and key == "base_color":
        draft.colors = str(_input(texture[0], "varname") or "")
        return 1.0, 1.0, 1.0
    if texture is not None and (texels := _texels(draft, name, texture)) is not None:
        draft.maps[key] = np.clip(texels, 0, 1)
        return 1.0, 1.0, 1.0
    numbers = np.broadcast_to(np.asarray(default if value is None else value, dtype=float), 3)
    return tuple(np.clip(np.nan_to_num(numbers), 0, np.inf if key == "emission" else 1).tolist())


def _number(draft: _Draft, name: str, key: str, default: float) -> float:
    value, texture = _source(draft, name)
    if texture is not None and (texels := _texels(draft, name, texture)) is not None:
        draft.maps[key] = np.clip(texels[..., 0], 0, 1)
        return 1.0
    return float(np.clip(np.nan_to_num(default if value is None else value), 0, 1))


def _constant(draft: _Draft, name: str, default: float) -> float:
    value, texture = _source(draft, name)
    if texture is not None:
        draft.left_out.append(f"texture of {name}")
    return float(np.nan_to_num(default if value is None else value))


def _normal(draft: _Draft) -> None:
    """The normal map, as it is encoded; scale and bias turn texels into vectors."""
    _, texture = _source(draft, "normal")
    if texture is not None and (texels := _texels(draft, "normal", texture)) is not None:
        plain = _input(texture[0], "scale") is None and _input(texture[0], "bias") is None
        normals, faults = mended_normals(texels if plain else (texels + 1) / 2, "normal map")
        draft.left_out += faults
        draft.maps |= {} if normals is None else {"normal": normals}
        draft.left_out += ["scale and bias of the normal map, missing, taken as 2 and -1"] if plain else []


def _name_the_rest(draft: _Draft) -> None:
    value, texture = _source(draft, "displacement")
    if texture is not None or value:
        draft.left_out.append("displacement")
    if _source(draft, "occlusion")[1] is not None:
        draft.left_out.append("occlusion")


# Where values come from

def _source(draft: _Draft, name: str) -> tuple[Any, "tuple[UsdShade.Shader, str] | None"]:
    """The value of an input, or the shader that gives it and by which output."""
    return _value_of(draft.shader, name)


def _value_of(shader: "UsdShade.Shader", name: str) -> tuple[Any, "tuple[UsdShade.Shader, str] | None"]:
    from pxr import Usd, UsdShade

    given = shader.GetInput(name)
    if not given:
        return None, None
    for attribute in UsdShade.Utils.GetValueProducingAttributes(given):
        base, kind = UsdShade.Utils.GetBaseNameAndType(attribute.GetName())
        if kind == UsdShade.AttributeType.Output:
            return None, (UsdShade.Shader(attribute.GetPrim()), base)
        return attribute.Get(Usd.TimeCode.EarliestTime()), None
    return None, None


def _input(shader: "UsdShade.Shader", name: str) -> Any:
    return _value_of(shader, name)[0]


def _texels(draft: _Draft, name: str, source: "tuple[UsdShade.Shader, str]") -> np.ndarray | None:
    """(H, W, 3) linear texels of an input, single channels repeated; None where its shader is not known."""
    shader, output = source
    if shader.GetIdAttr().Get() != "UsdUVTexture" or output not in CHANNELS:
        draft.left_out.append(f"{name} from {shader.GetIdAttr().Get() or 'an unknown shader'}")
        return None
    scale, bias = (np.array(given if given is not None else (default,) * 4, dtype=float)
                   for given, default in ((_input(shader, "scale"), 1.0), (_input(shader, "bias"), 0.0)))
    image = _image(draft, shader)
    if image is None:
        fallback = _input(shader, "fallback")
        texels = np.array(fallback if fallback is not None else (0, 0, 0, 1), dtype=float).reshape(1, 1, 4)
    else:
        space = _input(shader, "sourceColorSpace") or "auto"
        srgb = _is_decoded(image) if space == "auto" else space == "sRGB"
        texels = read_texels(image, srgb=srgb, max_size=draft.max_texture)
    layout = (*_coordinates(draft, shader), str(_input(shader, "wrapS")), str(_input(shader, "wrapT")))
    draft.layout = draft.layout or layout
    if layout != draft.layout:
        draft.left_out.append(f"coordinates and wrap of {name}, taken as those of its first texture")
    return (texels * scale + bias)[..., CHANNELS[output]]


def _is_decoded(image: ImageFile) -> bool:
    if holds_floats(image):
        return False
    with opened_image(image) as opened:
        return opened.mode in DECODED


def _coordinates(draft: _Draft, shader: "UsdShade.Shader") -> tuple[str, tuple[float, ...]]:
    """Name of the texture coordinates of a texture, and the (2, 3) map that they take, as six numbers."""
    _, source = _value_of(shader, "st")
    matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    if source is not None and source[0].GetIdAttr().Get() == "UsdTransform2d":
        turn = np.radians(float(_input(source[0], "rotation") or 0.0))
        scale, shift = (given if given is not None else default for given, default in (
            (_input(source[0], "scale"), (1.0, 1.0)), (_input(source[0], "translation"), (0.0, 0.0))))
        matrix = (float(np.cos(turn) * scale[0]), float(-np.sin(turn) * scale[1]), float(shift[0]),
                  float(np.sin(turn) * scale[0]), float(np.cos(turn) * scale[1]), float(shift[1]))
        _, source = _value_of(source[0], "in")
    if source is None or source[0].GetIdAttr().Get() != "UsdPrimvarReader_float2":
        if source is not None:
            draft.left_out.append(f"coordinates from {source[0].GetIdAttr().Get()}")
        return "st", matrix
    return str(_input(source[0], "varname") or "st"), matrix


def _image(draft: _Draft, shader: "UsdShade.Shader") -> ImageFile | None:
    """The image of a texture; None where it names none."""
    from pxr import Ar

    asset = _input(shader, "file")
    if asset is None or not asset.path:
        return None
    if UDIM in asset.path:
        refuse(draft.path, f"expected one image, got the tiles {asset.path}", "bake them into one texture",
               at=str(shader.GetPath()))
    outer, inner = Ar.SplitPackageRelativePathOuter(asset.resolvedPath)
    if not outer or not is_within(draft.folders, outer):
        refuse(draft.path, f"expected an existing file in its folder or below it, got {asset.path}",
               at=str(shader.GetPath()))
    if not inner:
        return ImageFile(name=outer, content=Path(outer))
    try:
        # What is packed is as large as in the package, or else may be any size
        with zipfile.ZipFile(io.BytesIO(read_regular(Path(outer), most=MOST_BYTES))) as package:
            if package.getinfo(inner).compress_type != zipfile.ZIP_STORED:
                refuse(draft.path, f"expected a package without compression, got {inner} compressed")
            return ImageFile(name=f"{inner} of {Path(outer).name}", content=package.read(inner))
    except (OSError, KeyError, ValueError, RuntimeError, zipfile.BadZipFile) as error:
        refuse(draft.path, f"expected a readable image {inner} in the package, got: {error}")
