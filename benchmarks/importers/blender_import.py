"""Runs inside Blender's Python: reads mesh files by Blender's own importers and shows their base colours, as told line
by line on standard input.

Each line is a JSON object, {"path": ..., "extents": ..., "camera": ..., "size": ..., "spp": ..., "out": ...}, and gets
one in return, {"extents": ..., "notes": ...} or {"error": ...}. The model is moved to where ours stands, and scaled to
its size; `extents` are its own. What is drawn is base colour times (1 - metallic) times (1 - transmission) as an
emission, so that neither lights nor noise come in, behind coverage by alpha.
"""

import json
import math
import os
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

Y_UP = {"forward_axis": "NEGATIVE_Z", "up_axis": "Y"}
GREY = 0.6
"""What our renderer gives to a surface without material or colours, as documented."""
IMPORTERS = {
    ".gltf": lambda path: bpy.ops.import_scene.gltf(filepath=path),
    ".glb": lambda path: bpy.ops.import_scene.gltf(filepath=path),
    ".obj": lambda path: bpy.ops.wm.obj_import(filepath=path, **Y_UP),
    ".ply": lambda path: bpy.ops.wm.ply_import(filepath=path, **Y_UP),
    ".stl": lambda path: bpy.ops.wm.stl_import(filepath=path, **Y_UP),
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), lambda path: bpy.ops.wm.usd_import(filepath=path)),
}


def imported(path: Path) -> list:
    """The file's mesh objects in a scene of nothing else."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    IMPORTERS[path.suffix.lower()](str(path))
    bpy.context.view_layer.update()
    return [thing for thing in bpy.context.scene.objects if thing.type == "MESH"]


def bounds() -> np.ndarray:
    """(2, 3) least and largest coordinates of the corners of faces, in world space, modifiers applied."""
    depsgraph, found = bpy.context.evaluated_depsgraph_get(), []
    for instance in depsgraph.object_instances:
        if instance.object.type != "MESH":
            continue
        mesh = instance.object.data
        points, corners = np.empty(3 * len(mesh.vertices)), np.empty(len(mesh.loops), dtype=np.int64)
        mesh.vertices.foreach_get("co", points)
        mesh.loops.foreach_get("vertex_index", corners)
        if len(corners):
            matrix = np.array(instance.matrix_world)
            moved = points.reshape(-1, 3)[np.unique(corners)] @ matrix[:3, :3].T + matrix[:3, 3]
            found.append([moved.min(axis=0), moved.max(axis=0)])
    if not found:
        raise ValueError("no faces")
    pairs = np.array(found)
    return np.array([pairs[:, 0].min(axis=0), pairs[:, 1].max(axis=0)])


def place(extents: list) -> np.ndarray:
    """Stand the model where ours does, as large as ours; its own extents."""
    low, high = bounds()
    theirs, ours = high - low, np.array(extents)
    scale = float(np.linalg.norm(ours) / np.linalg.norm(theirs))
    move = np.eye(4)
    move[:3] *= scale
    move[:3, 3] = -scale * np.array([*(low + high)[:2] / 2, low[2]])
    for thing in bpy.context.scene.objects:
        if thing.parent is None:
            thing.matrix_world = Matrix(move.tolist()) @ thing.matrix_world
    bpy.context.view_layer.update()
    return theirs


def show_base_colours(things: list) -> list[str]:
    """Replace what every material sends out by its base colour; notes on those that have none."""
    notes = []
    for thing in things:
        colours = thing.data.color_attributes.active_color
        for slot in range(max(1, len(thing.data.materials))):
            if not len(thing.data.materials):
                thing.data.materials.append(None)
            if thing.data.materials[slot] is None:
                thing.data.materials[slot] = _without_material(colours.name if colours else "")
                notes.append("vertex colours alone" if colours else "no material")
    for material in bpy.data.materials:
        if material.node_tree is None or "base" in material:
            continue
        principled = next((n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED"), None)
        if principled is None:
            notes.append(f"{material.name}: no principled surface, drawn as it is")
        else:
            _show(material.node_tree, principled)
    return list(dict.fromkeys(notes))


def _without_material(colours: str) -> object:
    """An emission of vertex colours, or of the grey."""
    material = bpy.data.materials.new("none")
    material.use_nodes = True
    material["base"] = True
    tree = material.node_tree
    tree.nodes.clear()
    emission, out = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    emission.inputs["Color"].default_value = (GREY, GREY, GREY, 1)
    if colours:
        attribute = tree.nodes.new("ShaderNodeVertexColor")
        attribute.layer_name = colours
        tree.links.new(attribute.outputs["Color"], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], out.inputs["Surface"])
    return material


def _show(tree: object, principled: object) -> None:
    def wire(name: str, to: object) -> None:
        socket = principled.inputs[name]
        if socket.is_linked:
            tree.links.new(socket.links[0].from_socket, to)
        else:
            to.default_value = socket.default_value

    emission, clear, mix, out = (tree.nodes.new(f"Shader{kind}") for kind in (
        "NodeEmission", "NodeBsdfTransparent", "NodeMixShader", "NodeOutputMaterial"))
    wire("Base Color", emission.inputs["Color"])
    strength = tree.nodes.new("ShaderNodeMath")
    strength.operation = "MULTIPLY"
    for index, name in enumerate(("Metallic", "Transmission Weight")):
        rest = tree.nodes.new("ShaderNodeMath")
        rest.operation, rest.inputs[0].default_value = "SUBTRACT", 1
        wire(name, rest.inputs[1])
        tree.links.new(rest.outputs[0], strength.inputs[index])
    tree.links.new(strength.outputs[0], emission.inputs["Strength"])
    wire("Alpha", mix.inputs[0])
    tree.links.new(clear.outputs[0], mix.inputs[1])
    tree.links.new(emission.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], out.inputs["Surface"])
    for node in tree.nodes:
        if node.type == "OUTPUT_MATERIAL":
            node.is_active_output = node == out


def set_camera(camera: dict) -> None:
    """A pinhole at `position` with `axes` right, up and forward, and `fov` degrees across."""
    data = bpy.data.cameras.new("camera")
    data.sensor_fit, data.angle = "HORIZONTAL", math.radians(camera["fov"])
    data.clip_start, data.clip_end = 1e-3, 1e4
    thing = bpy.data.objects.new("camera", data)
    bpy.context.scene.collection.objects.link(thing)
    right, up, forward = np.array(camera["axes"])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = np.stack([right, up, -forward], axis=1), camera["position"]
    thing.matrix_world = Matrix(matrix.tolist())
    bpy.context.scene.camera = thing


def render(order: dict, threads: int) -> None:
    """Write R, G, B, A of `size` pixels a side, box filter, linear, in front of nothing."""
    scene, cycles = bpy.context.scene, bpy.context.scene.cycles
    scene.world = None
    scene.render.engine = "CYCLES"
    scene.render.resolution_x = scene.render.resolution_y = order["size"]
    scene.render.resolution_percentage = 100
    scene.render.threads_mode, scene.render.threads = "FIXED", threads
    scene.render.film_transparent = True
    scene.view_settings.view_transform = "Raw"
    cycles.device, cycles.pixel_filter_type, cycles.filter_width = "CPU", "BOX", 1.0
    cycles.samples, cycles.seed, cycles.use_adaptive_sampling, cycles.use_denoising = order["spp"], 1, False, False
    cycles.transparent_max_bounces = 64
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGBA"
    bpy.ops.render.render()
    bpy.data.images["Render Result"].save_render(order["out"])


def answer(order: dict, threads: int) -> dict:
    """What became of one file."""
    try:
        things = imported(Path(order["path"]))
        extents = place(order["extents"])
        notes = show_base_colours(things)
        set_camera(order["camera"])
        render(order, threads)
    except (RuntimeError, ValueError, KeyError, AttributeError, TypeError, OSError) as error:
        return {"error": str(error).strip() or type(error).__name__}
    return {"extents": extents.tolist(), "notes": notes}


def main() -> None:
    """Answer until standard input ends; what Blender prints goes to standard error."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    answers.write(json.dumps({"version": bpy.app.version_string}) + "\n")
    for line in sys.stdin:
        answers.write(json.dumps(answer(json.loads(line), int(sys.argv[1]))) + "\n")


if __name__ == "__main__":
    main()
