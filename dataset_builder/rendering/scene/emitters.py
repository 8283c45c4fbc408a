"""Lights of a plan -> Mitsuba emitters, padded to constant slots.

Dr.Jit compiles a kernel per scene structure, so every scene holds at least one light of each kind that specs may ask
for. The spare ones are dark, tiny, under the floor, and never sampled. Images of lights make other kernels, one for
domes of each size and one for area lights, all of which show an image as soon as one does; so do disks and cylinders,
which only files have.

A dome's image is latitude and longitude: its upper edge is the zenith, its middle column lies towards +X, and a quarter
of its width further left towards +Y; `turn` degrees carry it about +Z from +X to +Y.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.errors import PlanError
from dataset_builder.geometry.light_axes import upward
from dataset_builder.label.scene_plan import IlluminationPlan, LightPlan
from dataset_builder.light_kinds import LIGHT_KINDS, Image, LightName
from dataset_builder.planning.view.emission import beam_of
from dataset_builder.rendering.scene.images import LAMP_SIDE, environment, lamp_texture, read_image
from dataset_builder.rendering.scene.shapes import is_small_sphere, small_sphere
from dataset_builder.spec.image_uses import ENVIRONMENT_SUFFIXES, TEXTURE_SUFFIXES

SPARE_DEPTH = -240.0
"""Height of spare lights: far below any floor, within the cube that `shapes` pads scenes to."""

SPARE_SIZE = 1e-4


@dataclass(frozen=True, kw_only=True)
class _Images:
    """The images that lights show."""

    root: Path | None
    """Folder that they are found below."""
    on_lamps: bool
    """Whether area lights show any."""

    def of(self, light: LightPlan) -> np.ndarray:
        """The image of a light that has one."""
        if self.root is None:
            raise PlanError(f"lights: expected the folder of the image {light.image}, got none")
        suffixes = _SUFFIXES[LIGHT_KINDS[light.kind].image]
        return read_image(self.root / light.image, light.image_sha256, suffixes)


_SUFFIXES: dict[Image, tuple[str, ...]] = {"": (), "environment": ENVIRONMENT_SUFFIXES, "texture": TEXTURE_SUFFIXES}


def emitters(illumination: IlluminationPlan, image_root: Path | None = None) -> dict[str, Any]:
    """Entries of a Mitsuba scene dict; images of lights are found below `image_root`.

    Lights are sampled in proportion to their weight, what they send to the target object. Raises PlanError for more
    than one dome, no light at all, or an image that cannot be shown.
    """
    entries: dict[str, Any] = {}
    lamps = (light for light in illumination.lights if LIGHT_KINDS[light.kind].image == "texture")
    images = _Images(root=image_root, on_lamps=any(light.image for light in lamps))
    for kind, row in LIGHT_KINDS.items():
        make, slots = _MAKERS[kind], row.slots
        lights = [light for light in illumination.lights if light.kind == kind and not is_small_sphere(light)]
        if slots and len(lights) > slots:
            raise PlanError(f"lights: expected at most {slots} of kind {kind}, got {len(lights)}")
        spares = [_spare(kind)] * ((slots or _power_of_two(len(lights))) - len(lights)) if row.spare or lights else []
        for index, light in enumerate([*lights, *spares]):
            entries[f"{kind}_{index}"] = make(light, images)
    for index, light in enumerate(filter(is_small_sphere, illumination.lights)):
        entries[f"bead_{index}"] = small_sphere(light, _black(), _surface_emitter(light))
    if not any(light.weight > 0 and any(light.radiance) for light in illumination.lights):
        raise PlanError("lights: expected at least one with a radiance above 0, got none")
    return entries


def _power_of_two(count: int) -> int:
    """Slots for `count` lights of a kind: few different numbers make few different kernels."""
    return 1 << max(count - 1, 0).bit_length()


def _spare(kind: LightName) -> LightPlan:
    return LightPlan(kind=kind, position=(0, 0, SPARE_DEPTH), direction=(0, 0, -1), size=SPARE_SIZE, cutoff=30,
                     radiance=(0, 0, 0), temperature=0, weight=0)


def _dome(light: LightPlan, images: _Images) -> dict[str, Any]:
    if not light.image:
        return {"type": "constant", "radiance": _rgb(light), "sampling_weight": light.weight}
    texels = environment(images.of(light))
    return {"type": "envmap", "bitmap": mi.Bitmap(texels * np.array(light.radiance, dtype=np.float32)),
            "to_world": mi.ScalarTransform4f().rotate([0, 0, 1], light.turn) @ _upright(),
            "sampling_weight": light.weight}


def _upright() -> mi.ScalarTransform4f:
    """Mitsuba's image of the sky has its zenith along +Y and its middle along +Z; ours +Z and +X."""
    return mi.ScalarTransform4f([[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


def _sun(light: LightPlan, _: _Images) -> dict[str, Any]:
    return {"type": "directional", "direction": light.direction, "irradiance": _rgb(light),
            "sampling_weight": light.weight}


def _area(light: LightPlan, images: _Images) -> mi.Shape:
    to_world = _facing(light) @ mi.ScalarTransform4f().scale([light.size / 2, (light.length or light.size) / 2, 1])
    area = mi.load_dict({"type": "rectangle", "bsdf": _black(),
                         "emitter": _screen(light, images) if images.on_lamps else _surface_emitter(light)})
    return _with_opaque(area, to_world=mi.AffineTransform4f(to_world))


def _disk(light: LightPlan, _: _Images) -> mi.Shape:
    return _stretched("disk", light, [light.size, light.size, 1])


def _cylinder(light: LightPlan, _: _Images) -> mi.Shape:
    return _stretched("cylinder", light, [light.size, light.size, light.length],
                      mi.ScalarTransform4f().translate([0, 0, -0.5]))


def _stretched(shape: str, light: LightPlan, scale: list[float], first: mi.ScalarTransform4f | None = None) -> mi.Shape:
    """A shape of Mitsuba's that shines, moved by `first`, scaled, and turned to the light's direction."""
    plugin = mi.load_dict({"type": shape, "bsdf": _black(), "emitter": _surface_emitter(light)})
    to_world = _facing(light) @ mi.ScalarTransform4f().scale(scale)
    return _with_opaque(plugin, to_world=mi.AffineTransform4f(to_world @ first if first else to_world))


def _sphere(light: LightPlan, _: _Images) -> dict[str, Any]:
    return {"type": "sphere", "center": light.position, "radius": light.size, "bsdf": _black(),
            "emitter": _surface_emitter(light)}


def _point(light: LightPlan, _: _Images) -> dict[str, Any]:
    return {"type": "point", "position": light.position, "intensity": _rgb(light), "sampling_weight": light.weight}


def _spot(light: LightPlan, _: _Images) -> mi.Emitter:
    spot = mi.load_dict({"type": "spot", "to_world": _facing(light), "intensity": _rgb(light),
                         "sampling_weight": light.weight})
    return _with_opaque(spot, cutoff_angle=mi.Float(light.cutoff), beam_width=mi.Float(beam_of(light)))


def _with_opaque(plugin: mi.Object, **values: Any) -> Any:
    """The plugin with some of its parameters as device values; given in its dict they would be literals of the
    kernel."""
    params = mi.traverse(plugin)
    for name, value in values.items():
        dr.make_opaque(value)
        params[name] = value
    params.update()
    return plugin


def _facing(light: LightPlan) -> mi.ScalarTransform4f:
    """Transform whose +Z is the light's direction; a rectangle's turn comes first."""
    position, direction = np.array(light.position), np.array(light.direction)
    facing = mi.ScalarTransform4f().look_at(list(position), list(position + direction), upward(light.direction))
    return facing @ mi.ScalarTransform4f().rotate([0, 0, 1], light.turn) if light.turn else facing


def _surface_emitter(light: LightPlan) -> dict[str, Any]:
    return {"type": "area", "radiance": _rgb(light), "sampling_weight": light.weight}


def _screen(light: LightPlan, images: _Images) -> dict[str, Any]:
    """An area emitter that shows an image, or an even one where the light has none."""
    even = np.ones((LAMP_SIDE, LAMP_SIDE, 3), dtype=np.float32)
    shown = lamp_texture(images.of(light)) if light.image else even
    # Mitsuba has the upper row at the lower edge, where squares that are drawn have always had it
    shown = shown[::-1] if light.length else shown
    # A black image could not be sampled, which Mitsuba refuses even for a spare light
    texels = np.maximum(shown * np.array(light.radiance, dtype=np.float32), np.finfo(np.float32).tiny)
    return {"type": "area", "radiance": {"type": "bitmap", "bitmap": mi.Bitmap(texels), "raw": True},
            "sampling_weight": light.weight}


def _black() -> dict[str, Any]:
    return {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.0, 0.0, 0.0]}}


def _rgb(light: LightPlan) -> dict[str, Any]:
    return {"type": "rgb", "value": list(light.radiance)}


_MAKERS: dict[LightName, Callable[[LightPlan, _Images], Any]] = {
    "dome": _dome, "sun": _sun, "area": _area, "sphere": _sphere, "point": _point, "spot": _spot,
    "disk": _disk, "cylinder": _cylinder,
}
