"""One example as a folder that Blender's interpreter can read: `scene.json`, `meshes.npz`, `textures.npz`.

Nothing is approximated here: triangles, corner normals, texture coordinates, linear texels and lights are those that
our own renderer is given.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.geometry.pinhole import look_at
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.scene_plan import IlluminationPlan
from dataset_builder.planning.view.emission import BEAM_SHARE
from dataset_builder.rendering.scene.triangle_soup import PARTS, Soup, clean, merge, rough_twin, surroundings

MAPS = ("base_color", "roughness", "metallic", "normal")
BEYOND = ("transmission", "coat", "abbe")
"""Effects that the two renderers model too differently to be compared."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """meshes: name -> soup; `target` and `rough` take each other's place, the rest are parts of the surroundings.

    open: parts left out under the source light.
    """

    meshes: Mapping[str, Soup]
    materials: Sequence[Material]
    lights: Mapping[str, IlluminationPlan]


def scene_of(plan: ExamplePlan, mesh_root: Path) -> Scene:
    """Everything that the passes of an example see.

    Raises ValueError for materials or air that are not compared.
    """
    target, room = clean(plan.target, mesh_root), surroundings(plan, mesh_root)
    rough = rough_twin(plan.target, plan.rough, mesh_root).soup
    everything = merge([target, room])
    _comparable(plan, everything.materials)
    shifted = merge([target.without(PARTS), room])
    parts = {name: shifted.without([other for other in PARTS if other != name]) for name in PARTS}
    return Scene(meshes={"target": target, "rough": rough, **parts}, materials=everything.materials,
                 lights={"source": plan.source_light, "target": plan.target_light})


def _comparable(plan: ExamplePlan, materials: Sequence[Material]) -> None:
    odd = sorted({material.name for material in materials
                  if any(getattr(material, name) for name in BEYOND) or any(material.sheen)})
    images = [light for lit in (plan.source_light, plan.target_light) for light in lit.lights if light.image]
    if odd or images or plan.fog.extinction:
        raise ValueError(f"expected opaque uncoated materials, clear air and lights without images, got {odd}, "
                         f"extinction {plan.fog.extinction}, {len(images)} images; choose another example")


def write(plan: ExamplePlan, scene: Scene, folder: Path) -> None:
    """Write the three files into `folder`, which is made."""
    folder.mkdir(parents=True, exist_ok=True)
    textures = list({id(m.texture): m.texture for m in scene.materials if m.texture is not None}.values())
    rows = {id(texture): row for row, texture in enumerate(textures)}
    described = [_material(m, rows.get(id(m.texture), -1)) for m in scene.materials]
    np.savez(folder / "textures.npz", **{f"{row}/{name}": array for row, texture in enumerate(textures)
                                         for name, array in _maps(texture).items()})
    np.savez(folder / "meshes.npz", **{f"{name}/{field}": getattr(soup, field) for name, soup in scene.meshes.items()
                                       for field in ("corners", "normals", "uvs", "material")})
    found = {
        "meshes": list(scene.meshes), "materials": described, "beam_share": BEAM_SHARE,
        "camera": _camera(plan), "width": plan.render.width, "height": plan.render.height,
        "max_depth": {name: plan.effects.of(name).max_depth for name in ("source", "target", "rough")},
        "open": list(plan.source_light.open),
        "lights": {name: [light.model_dump(mode="json") for light in lit.lights]
                   for name, lit in scene.lights.items()},
    }
    (folder / "scene.json").write_text(json.dumps(found, indent=1))


def _material(material: Material, texture: int) -> dict[str, Any]:
    return {"name": material.name, "base_color": list(material.base_color), "roughness": material.roughness,
            "metallic": material.metallic, "specular": material.specular, "texture": texture}


def _maps(texture: Texture) -> dict[str, np.ndarray]:
    return {name: array for name in MAPS if (array := getattr(texture, name)) is not None}


def _camera(plan: ExamplePlan) -> dict[str, Any]:
    """Position, and (3, 3) rows right, up, forward in world space; `fov` is horizontal, in degrees."""
    camera = plan.camera
    return {"position": list(camera.position), "axes": look_at(camera.position, camera.target, camera.up).tolist(),
            "fov": camera.fov}
