"""Materials -> UsdPreviewSurface, and in words what that cannot say: openusd.org/release/spec_usdpreviewsurface.html"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from dataset_builder.assets.asset import Material, Texture, range_of
from dataset_builder.exporting.placed_things import prim_name
from dataset_builder.exporting.texel_files import TexelFiles

if TYPE_CHECKING:
    from pxr import Usd, UsdShade

COORDINATES, COLOR, OPACITY = "st", "displayColor", "displayOpacity"
"""Primvars that materials read."""


def index_of(specular: float) -> float:
    """Index of refraction whose reflectance at normal incidence is `specular`: (1 + sqrt F0) / (1 - sqrt F0).

    >>> round(index_of(0.04), 12), index_of(0.0)
    (1.5, 1.0)
    """
    root = sqrt(specular)
    return (1 + root) / (1 - root)


def not_said(material: Material) -> tuple[str, ...]:
    """What of a material UsdPreviewSurface has no words for."""
    texture = material.texture
    found = [
        ("sheen", range_of(material, "sheen")[1] > 0),
        ("transmission, written as opacity that lets light straight on", range_of(material, "transmission")[1] > 0),
        ("that it is thin", material.thin and range_of(material, "transmission")[1] > 0),
        ("dispersion", material.abbe > 0 and range_of(material, "transmission")[1] > 0),
        ("map of specular, written as its largest value", texture is not None and texture.specular is not None),
        ("texels shown as squares", texture is not None and texture.nearest),
    ]
    return tuple(what for what, there in found if there)


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceWriter:
    """Writes materials below a scope; each is written once for faces with colours and once for those without."""

    stage: "Usd.Stage"
    scope: str
    """Path of the prim that they are below."""
    files: TexelFiles
    sky: float
    """Radiance of a unit of emission."""
    _known: dict[tuple[int, bool, bool], "UsdShade.Material"] = field(default_factory=dict)
    _kept: list[Material] = field(default_factory=list)
    lost: dict[str, list[str]] = field(default_factory=dict)
    """What cannot be said, with the materials that it is said of."""

    def material(self, material: Material, *, colors: bool = False, opacities: bool = False) -> "UsdShade.Material":
        """The prim of a material. colors, opacities: whether its faces have colours of vertices, and whether those
        are not there in part."""
        key = id(material), colors, opacities
        if key not in self._known:
            self._kept.append(material)
            self._known[key] = self._write(material, colors, opacities)
        return self._known[key]

    def _write(self, material: Material, colors: bool, opacities: bool) -> "UsdShade.Material":
        from pxr import UsdShade

        taken = [prim.GetName() for prim in self.stage.GetPrimAtPath(self.scope).GetChildren()]
        made = UsdShade.Material.Define(self.stage, f"{self.scope}/{prim_name(material.name, taken)}")
        shader = UsdShade.Shader.Define(self.stage, made.GetPath().AppendChild("Surface"))
        shader.CreateIdAttr("UsdPreviewSurface")
        made.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        made.GetPrim().SetCustomDataByKey("name", material.name)
        lost = [*not_said(material), *self._inputs(_Inputs(writer=self, shader=shader, material=material), colors,
                                                   opacities)]
        if lost:
            made.GetPrim().SetCustomDataByKey("notSaid", _strings(lost))
        for what in lost:
            self.lost.setdefault(what, []).append(material.name)
        return made

    def _inputs(self, to: "_Inputs", colors: bool, opacities: bool) -> list[str]:
        """Every input of a surface; what of the colours of vertices is lost to textures, in words."""
        material, texture, lost = to.material, to.material.texture, list[str]()
        if colors and (texture is None or to.plain("base_color")):
            to.read("diffuseColor", COLOR, "UsdPrimvarReader_float3", (1.0, 1.0, 1.0))
        else:
            to.color("diffuseColor", "base_color", material.base_color)
            lost += ["colours of vertices, which multiply a texture"] if colors else []
        to.number("roughness", "roughness", material.roughness)
        to.number("metallic", "metallic", material.metallic)
        to.set("ior", "Float", index_of(range_of(material, "specular")[1]))
        if range_of(material, "coat")[1] > 0:
            to.number("clearcoat", "coat", material.coat)
            to.number("clearcoatRoughness", "coat_roughness", material.coat_roughness)
        if any(material.emission):
            to.color("emissiveColor", "emission", [self.sky * part for part in material.emission])
        lost += self._opacity(to, opacities)
        to.normal()
        return lost

    def _opacity(self, to: "_Inputs", opacities: bool) -> list[str]:
        """Coverage; of what transmits, the share that does not."""
        material, texture = to.material, to.material.texture
        covered = texture is not None and texture.alpha is not None
        passes = material.transmission * (1 - material.metallic)
        cutoff = material.alpha_cutoff
        if cutoff == 0:
            return []
        if cutoff:
            to.set("opacityThreshold", "Float", cutoff)
        if opacities and not covered:
            to.read("opacity", OPACITY, "UsdPrimvarReader_float", 1.0)
        elif covered or passes == 0 or texture is None or texture.transmission is None:
            to.number("opacity", "alpha", material.alpha * (1 - passes))
        else:
            to.number("opacity", "transmission", -passes, bias=1.0)
        if passes == 0 and (opacities or range_of(material, "alpha")[0] < 1):
            to.set("opacityMode", "Token", "presence")
        return ["alpha of vertices, which multiplies a texture"] if opacities and covered else []


@dataclass(frozen=True, kw_only=True, eq=False)
class _Inputs:
    """One shader that is being written."""

    writer: SurfaceWriter
    shader: "UsdShade.Shader"
    material: Material

    def set(self, name: str, kind: str, value: Any) -> "UsdShade.Input":
        from pxr import Gf, Sdf

        made = self.shader.CreateInput(name, getattr(Sdf.ValueTypeNames, kind))
        made.Set(Gf.Vec3f(*map(float, value)) if kind == "Color3f" else value)
        return made

    def color(self, name: str, key: str, factor: Sequence[float]) -> None:
        """A colour: its factor, times a map where there is one."""
        self._mapped(name, "Color3f", key, factor, tuple(map(float, factor)), 0.0)

    def number(self, name: str, key: str, factor: float, *, bias: float = 0.0) -> None:
        """A number: its factor, times a map where there is one, plus a bias of the map."""
        self._mapped(name, "Float", key, factor, (float(factor),) * 3, bias)

    def normal(self) -> None:
        """A normal map, encoded to [0, 1] in its file."""
        texture = self.material.texture
        if texture is not None and texture.normal is not None:
            encoded = 0.5 + 0.5 * texture.normal.astype(np.float32)
            self._texture("normal", "Normal3f", encoded, "normal", (2.0,) * 3, -1.0)

    def read(self, name: str, primvar: str, shader: str, fallback: Any) -> None:
        """A value of the mesh."""
        from pxr import Sdf

        kind = Sdf.ValueTypeNames.Float3 if shader.endswith("3") else Sdf.ValueTypeNames.Float
        reader = self._child(f"{name}Reader", shader)
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set(primvar)
        reader.CreateInput("fallback", kind).Set(fallback)
        own = Sdf.ValueTypeNames.Color3f if shader.endswith("3") else Sdf.ValueTypeNames.Float
        reader.CreateOutput("result", kind)
        self.shader.CreateInput(name, own).ConnectToSource(reader.ConnectableAPI(), "result")

    def plain(self, key: str) -> bool:
        """Whether a map is one throughout."""
        texels = self._texels(key)
        return texels is None or bool((texels == 1).all())

    def _texels(self, key: str) -> np.ndarray | None:
        texture: Texture | None = self.material.texture
        return None if texture is None else getattr(texture, key)

    def _mapped(self, name: str, kind: str, key: str, factor: Any, scale: tuple[float, ...], bias: float) -> None:
        texels = self._texels(key)
        if texels is None or self.plain(key):
            self.set(name, kind, factor)
        else:
            self._texture(name, kind, texels, key, scale, bias)

    def _texture(self, name: str, kind: str, texels: np.ndarray, key: str, scale: tuple[float, ...],
                 bias: float) -> None:
        from pxr import Gf, Sdf

        types, texture = Sdf.ValueTypeNames, self.material.texture
        color = key in ("base_color", "emission")
        file = self.writer.files.write(texels, f"{self.material.name}-{key}", color=color)
        node = self._child(f"{name}Texture", "UsdUVTexture")
        node.CreateInput("file", types.Asset).Set(Sdf.AssetPath(f"./{file.path}"))
        node.CreateInput("sourceColorSpace", types.Token).Set(file.space)
        node.CreateInput("scale", types.Float4).Set(Gf.Vec4f(*scale, 1))
        node.CreateInput("bias", types.Float4).Set(Gf.Vec4f(bias, bias, bias, 0))
        for axis, wrap in zip("ST", texture.wrap if texture is not None else ("repeat",) * 2, strict=True):
            node.CreateInput(f"wrap{axis}", types.Token).Set(wrap)
        node.CreateInput("st", types.Float2).ConnectToSource(self._coordinates().ConnectableAPI(), "result")
        output = "r" if kind == "Float" else "rgb"
        node.CreateOutput(output, types.Float if kind == "Float" else types.Float3)
        self.shader.CreateInput(name, getattr(types, kind)).ConnectToSource(node.ConnectableAPI(), output)

    def _coordinates(self) -> "UsdShade.Shader":
        from pxr import Sdf, UsdShade

        path = self.shader.GetPath().ReplaceName("Coordinates")
        if not self.writer.stage.GetPrimAtPath(path):
            reader = self._child("Coordinates", "UsdPrimvarReader_float2")
            reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set(COORDINATES)
            reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        return UsdShade.Shader.Get(self.writer.stage, path)

    def _child(self, name: str, shader: str) -> "UsdShade.Shader":
        from pxr import UsdShade

        made = UsdShade.Shader.Define(self.writer.stage, self.shader.GetPath().ReplaceName(name))
        made.CreateIdAttr(shader)
        return made


def _strings(values: Sequence[str]) -> Any:
    from pxr import Vt

    return Vt.StringArray(list(values))
