"""Lights of a plan -> UsdLux. Radiance in W/(m^2 sr) is written where USD has nits, at exposure 0.

The largest channel is the intensity, the colour is what is left of it. A point has no surface: it is a normalised
sphere of a millimetre, of which pi times the intensity is the power, so that the intensity is 4 times ours in W/sr.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dataset_builder.exporting.texel_files import TexelFiles
from dataset_builder.geometry.pinhole import look_at
from dataset_builder.label.scene_plan import IlluminationPlan, LightPlan
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.view.emission import beam_of
from dataset_builder.spec.image_uses import ENVIRONMENT_SUFFIXES, TEXTURE_SUFFIXES

if TYPE_CHECKING:
    from pxr import Usd, UsdLux

POINT_RADIUS = 1e-3
"""Of what stands for a point, metres."""
DOME_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""World from dome: USD's image of the sky has its zenith along +Y and its middle along +Z, ours +Z and +X."""
FALLOFF = "falloff of spots, linear in the angle here and a smooth step in USD"


@dataclass(frozen=True, kw_only=True, eq=False)
class LightWriter:
    """Writes lights below a scope."""

    stage: "Usd.Stage"
    scope: str
    files: TexelFiles
    image_root: Path
    """Folder that images of lights are found below."""

    def write(self, illumination: IlluminationPlan) -> tuple[str, ...]:
        """Write every light that shines; what cannot be said of them, in words.

        Raises PlanError where an image is not the one that was planned.
        """
        for number, light in enumerate(illumination.lights):
            if any(light.radiance):
                self._write(light, f"{self.scope}/{light.kind}_{number}")
        return (FALLOFF,) if any(light.kind == "spot" for light in illumination.lights) else ()

    def _write(self, light: LightPlan, path: str) -> None:
        from pxr import Gf, UsdGeom, UsdLux

        prim = self._defined(light, path)
        api, peak = UsdLux.LightAPI(prim), max(light.radiance)
        point = LIGHT_KINDS[light.kind].quantity == "intensity"
        api.CreateIntensityAttr(4 * peak if point else peak)
        api.CreateExposureAttr(0.0)
        api.CreateNormalizeAttr(point)
        api.CreateColorAttr(Gf.Vec3f(*(channel / peak for channel in light.radiance)))
        placed = UsdGeom.Xformable(prim).AddTransformOp()
        placed.Set(Gf.Matrix4d(world_from_light(light).T.tolist()))
        prim.SetCustomDataByKey("kind", light.kind)
        if light.temperature:
            prim.SetCustomDataByKey("temperature", light.temperature)

    def _defined(self, light: LightPlan, path: str) -> "Usd.Prim":
        """The prim with what is its kind's own."""
        from pxr import UsdLux

        if light.kind == "dome":
            dome = UsdLux.DomeLight.Define(self.stage, path)
            if light.image:
                dome.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
                self._show(dome, light)
            return dome.GetPrim()
        if light.kind == "sun":
            sun = UsdLux.DistantLight.Define(self.stage, path)
            sun.CreateAngleAttr(0.0)
            return sun.GetPrim()
        if light.kind == "area":
            area = UsdLux.RectLight.Define(self.stage, path)
            area.CreateWidthAttr(light.size)
            area.CreateHeightAttr(light.length or light.size)
            area.CreateExtentAttr(_extent(light.size / 2, (light.length or light.size) / 2, 0.0))
            if light.image:
                self._show(area, light)
            return area.GetPrim()
        if light.kind == "disk":
            disk = UsdLux.DiskLight.Define(self.stage, path)
            disk.CreateRadiusAttr(light.size)
            disk.CreateExtentAttr(_extent(light.size, light.size, 0.0))
            return disk.GetPrim()
        if light.kind == "cylinder":
            tube = UsdLux.CylinderLight.Define(self.stage, path)
            tube.CreateRadiusAttr(light.size)
            tube.CreateLengthAttr(light.length)
            tube.CreateExtentAttr(_extent(light.length / 2, light.size, light.size))
            return tube.GetPrim()
        return self._ball(light, path).GetPrim()

    def _ball(self, light: LightPlan, path: str) -> "UsdLux.SphereLight":
        """A sphere, or what stands for a point or a spot."""
        from pxr import UsdLux

        ball, radius = UsdLux.SphereLight.Define(self.stage, path), POINT_RADIUS
        if light.kind == "sphere":
            radius = light.size
        else:
            ball.CreateTreatAsPointAttr(True)
        ball.CreateRadiusAttr(radius)
        ball.CreateExtentAttr(_extent(radius, radius, radius))
        if light.kind == "spot":
            shaping = UsdLux.ShapingAPI.Apply(ball.GetPrim())
            shaping.CreateShapingConeAngleAttr(light.cutoff)
            shaping.CreateShapingConeSoftnessAttr(1 - beam_of(light) / light.cutoff)
        return ball

    def _show(self, prim: "UsdLux.DomeLight | UsdLux.RectLight", light: LightPlan) -> None:
        """The image as rendering shows it: of mean luminance 1, in the size that it takes."""
        from dataset_builder.rendering.scene.images import environment, lamp_texture, read_image

        dome = light.kind == "dome"
        image = read_image(self.image_root / light.image, light.image_sha256,
                           ENVIRONMENT_SUFFIXES if dome else TEXTURE_SUFFIXES)
        file = self.files.write(environment(image) if dome else lamp_texture(image), Path(light.image).stem, color=True)
        prim.CreateTextureFileAttr(f"./{file.path}")


def world_from_light(light: LightPlan) -> np.ndarray:
    """(4, 4) rigid transform of a UsdLux prim: light leaves along its -Z, a cylinder lies along its X."""
    matrix = np.eye(4)
    if light.kind == "dome":
        c, s = np.cos(np.radians(light.turn)), np.sin(np.radians(light.turn))
        matrix[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ DOME_AXES
        return matrix
    if any(light.direction):
        direction = np.array(light.direction) / np.linalg.norm(light.direction)
        # The same choice as of the emitters, so that images stand upright alike
        up = (1.0, 0.0, 0.0) if abs(direction[2]) > 0.9 else (0.0, 0.0, 1.0)
        right, above, ahead = look_at(np.zeros(3), direction, up)
        axes = (ahead, above, right) if light.kind == "cylinder" else (right, above, -ahead)
        matrix[:3, :3] = np.stack(axes, axis=1) @ _turned(light)
    if not LIGHT_KINDS[light.kind].outside:
        matrix[:3, 3] = light.position
    return matrix


def _turned(light: LightPlan) -> np.ndarray:
    """(3, 3) turn of a rectangle by `turn` degrees about its direction, which is -Z here."""
    c, s = np.cos(np.radians(light.turn)), np.sin(np.radians(light.turn))
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def _extent(*half: float) -> Any:
    from pxr import Gf

    return [Gf.Vec3f(*(-side for side in half)), Gf.Vec3f(*half)]
