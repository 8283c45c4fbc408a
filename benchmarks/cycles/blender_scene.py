"""Runs inside Blender's Python: the folder of `scene_file` -> objects, materials, lamps and a camera of one scene.

Lamps are Blender's own (they are sampled better than glowing meshes), seen by the camera; a black shell just behind or
inside each that has an extent stops what hits it, as the lamps of our renderer do.
"""

import json
import math
from pathlib import Path

import bpy
import numpy as np
import units
from mathutils import Matrix, Vector

BACK, INSIDE = 1e-3, 0.99
"""Metres between a square and its shell; share of a sphere's radius at which its shell is."""


class Loaded:
    """The scene of one folder. `show` switches between the renders of a tuple."""

    def __init__(self, folder: Path):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.found = json.loads((folder / "scene.json").read_text())
        self.scene = bpy.context.scene
        with np.load(folder / "textures.npz") as texels, np.load(folder / "meshes.npz") as arrays:
            materials = [_material(entry, texels) for entry in self.found["materials"]]
            self.meshes = {name: _mesh(name, arrays, materials, self._place) for name in self.found["meshes"]}
        self.lamps = {name: [thing for light in lights for thing in self._lamp(light)]
                      for name, lights in self.found["lights"].items()}
        self._camera(self.found["camera"])
        self.scene.world = _world()

    def show(self, name: str) -> None:
        """Leave what the render `name` sees: source, target or rough."""
        lit = "source" if name == "source" else "target"
        hidden = set(self.found["open"]) if name == "source" else set()
        hidden.add("target" if name == "rough" else "rough")
        for mesh, thing in self.meshes.items():
            thing.hide_render = mesh in hidden
        for light, things in self.lamps.items():
            for thing in things:
                thing.hide_render = light != lit
        domes = [light["radiance"] for light in self.found["lights"][lit] if light["kind"] == "dome"]
        background = self.scene.world.node_tree.nodes["Background"].inputs
        background["Color"].default_value = (*(domes[0] if domes else (0, 0, 0)), 1)

    def _place(self, name: str, data: object) -> object:
        thing = bpy.data.objects.new(name, data)
        self.scene.collection.objects.link(thing)
        return thing

    def _camera(self, camera: dict) -> None:
        data = bpy.data.cameras.new("camera")
        data.sensor_fit, data.angle = "HORIZONTAL", math.radians(camera["fov"])
        data.clip_start, data.clip_end = 1e-3, 1e4
        thing = self._place("camera", data)
        right, up, forward = np.array(camera["axes"])
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = np.stack([right, up, -forward], axis=1), camera["position"]
        thing.matrix_world = Matrix(matrix.tolist())
        self.scene.camera = thing

    def _lamp(self, light: dict) -> list:
        """The lamp and its shell; a dome has none, it is the world."""
        kind = light["kind"]
        if kind == "dome":
            return []
        data = bpy.data.lights.new(kind, {"sphere": "POINT"}.get(kind, kind.upper()))
        data.color, peak = units.tint_and_peak(light["radiance"])
        data.energy = units.power(kind, peak, light["size"])
        _shape_lamp(data, light, self.found["beam_share"])
        thing = self._place(kind, data)
        thing.visible_camera = True
        aim = Vector(light["direction"]) if any(light["direction"]) else Vector((0, 0, -1))
        turn = aim.to_track_quat("-Z", "Y").to_matrix().to_4x4()
        thing.matrix_world = Matrix.Translation(light["position"]) @ turn
        shell = _shell(light)
        if shell is None:
            return [thing]
        behind = self._place(f"{kind} shell", shell)
        behind.matrix_world = thing.matrix_world.copy()
        return [thing, behind]


def _shape_lamp(data: object, light: dict, beam_share: float) -> None:
    if data.type == "SUN":
        data.angle = 0
    elif data.type == "AREA":
        data.shape, data.size, data.spread = "SQUARE", light["size"], math.pi
    else:
        data.shadow_soft_size, data.use_soft_falloff = light["size"], False
    if data.type == "SPOT":
        data.spot_size = 2 * math.radians(light["cutoff"])
        data.spot_blend = units.spot_blend(light["cutoff"], beam_share * light["cutoff"])


def _shell(light: dict) -> object | None:
    """A black mesh that stops what meets a lamp from behind or goes through it."""
    import bmesh

    if light["kind"] not in ("area", "sphere"):
        return None
    built, mesh = bmesh.new(), bpy.data.meshes.new("shell")
    if light["kind"] == "area":
        bmesh.ops.create_grid(built, x_segments=1, y_segments=1, size=light["size"] / 2,
                              matrix=Matrix.Translation((0, 0, BACK)))
    else:
        bmesh.ops.create_icosphere(built, subdivisions=4, radius=INSIDE * light["size"])
    built.to_mesh(mesh)
    built.free()
    mesh.materials.append(_diffuse("shell", (0, 0, 0)))
    return mesh


def _world() -> object:
    world = bpy.data.worlds.new("world")
    if world.node_tree is None:
        world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    background = nodes.new("ShaderNodeBackground")
    background.name = "Background"
    links.new(background.outputs[0], nodes.new("ShaderNodeOutputWorld").inputs["Surface"])
    return world


# Meshes


def _mesh(name: str, arrays: object, materials: list, place: object) -> object:
    """An object of separate triangles, so that normals and texture coordinates may differ at every corner."""
    corners, normals, uvs, material = (arrays[f"{name}/{field}"] for field in ("corners", "normals", "uvs", "material"))
    count = len(corners)
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(3 * count)
    mesh.vertices.foreach_set("co", corners.astype(np.float32).ravel())
    mesh.loops.add(3 * count)
    mesh.loops.foreach_set("vertex_index", np.arange(3 * count, dtype=np.int32))
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * count, 3, dtype=np.int32))
    used, slots = np.unique(material, return_inverse=True)
    for row in used:
        mesh.materials.append(materials[row])
    mesh.polygons.foreach_set("material_index", slots.astype(np.int32).ravel())
    mesh.uv_layers.new(name="uv").uv.foreach_set("vector", uvs.astype(np.float32).ravel())
    mesh.update()
    mesh.normals_split_custom_set(normals.reshape(-1, 3).astype(np.float32).tolist())
    return place(name, mesh)


# Materials


def _material(entry: dict, texels: object) -> object:
    """Principled, or Diffuse where nothing is specular; factors are multiplied into the images beforehand."""
    maps = {name: texels[key] for name in ("base_color", "roughness", "metallic", "normal")
            if (key := f"{entry['texture']}/{name}") in texels}
    matte = not entry["specular"] and not entry["metallic"]
    material = (_diffuse if matte else _principled)(entry["name"], entry["base_color"])
    nodes, links = material.node_tree.nodes, material.node_tree.links
    shader = nodes["Shader"]
    if not matte:
        shader.inputs["Roughness"].default_value = entry["roughness"]
        shader.inputs["Metallic"].default_value = entry["metallic"]
        shader.inputs["Specular IOR Level"].default_value = units.specular_level(entry["specular"])
    for name, socket in (("base_color", shader.inputs[0].name), ("roughness", "Roughness"), ("metallic", "Metallic")):
        if name in maps and not (matte and name != "base_color") and np.any(entry[name]):
            image = _image(maps[name] * np.asarray(entry[name], dtype=np.float32))
            links.new(_texture(nodes, image).outputs["Color"], shader.inputs[socket])
    if "normal" in maps:
        bump = nodes.new("ShaderNodeNormalMap")
        links.new(_texture(nodes, _image(0.5 + 0.5 * maps["normal"])).outputs["Color"], bump.inputs["Color"])
        links.new(bump.outputs["Normal"], shader.inputs["Normal"])
    return material


def _diffuse(name: str, colour: tuple) -> object:
    return _shaded(name, "ShaderNodeBsdfDiffuse", colour)


def _principled(name: str, colour: tuple) -> object:
    """Single-scattering GGX, as our surface has it."""
    material = _shaded(name, "ShaderNodeBsdfPrincipled", colour)
    material.node_tree.nodes["Shader"].distribution = "GGX"
    return material


def _shaded(name: str, shader: str, colour: tuple) -> object:
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    node = nodes.new(shader)
    node.name = "Shader"
    node.inputs[0].default_value = (*colour, 1)
    links.new(node.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def _texture(nodes: object, image: object) -> object:
    node = nodes.new("ShaderNodeTexImage")
    node.image, node.interpolation, node.extension = image, "Linear", "REPEAT"
    return node


def _image(values: np.ndarray) -> object:
    """A packed linear image of (H, W) or (H, W, 3) values; Blender's first row is the lowest."""
    height, width = values.shape[:2]
    pixels = np.ones((height, width, 4), dtype=np.float32)
    pixels[..., :3] = values if values.ndim == 3 else values[..., None]
    image = bpy.data.images.new("texels", width, height, alpha=False, float_buffer=True, is_data=True)
    image.pixels.foreach_set(pixels[::-1].ravel())
    image.pack()
    return image
