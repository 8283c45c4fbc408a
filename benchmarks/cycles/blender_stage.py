"""Runs inside Blender's Python: opens USD stages by Blender's own importer, tells what it made of them, and renders.

Each line on standard input is a JSON object and gets one in return: {"do": "open", "path": ..., "width": ...,
"height": ..., "bounces": ...} and {"do": "render", ...} as `blender_side` has it. Two things are put right after the
import, since they are the importer's own: it takes a distant light for four times as bright as it is, and it knows no
sky where a scene has no world.
"""

import json
import os
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
from blender_side import bound, render, settle

SUN_FACTOR = 4.0
"""Energy that Blender's importer gives a distant light, over its intensity."""


def opened(order: dict, threads: int) -> tuple[SimpleNamespace, dict]:
    """The scene as `blender_side` wants one, and what is in it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
    bpy.ops.wm.usd_import(filepath=order["path"])
    bpy.context.view_layer.update()
    scene.camera = next(thing for thing in scene.objects if thing.type == "CAMERA")
    for thing in scene.objects:
        if thing.type == "LIGHT":
            thing.visible_camera = True
            if thing.data.type == "SUN":
                thing.data.energy /= SUN_FACTOR
    loaded = SimpleNamespace(scene=scene, found=order)
    settle(loaded, threads)
    bound(loaded, order["bounces"])
    return loaded, {"meshes": _meshes(scene), "lights": _lights(scene), "camera": _camera(scene.camera),
                    "world": _world(scene.world)}


def _meshes(scene: object) -> dict:
    """Faces and the box in the world of every mesh, by its name."""
    found = {}
    for thing in scene.objects:
        if thing.type == "MESH":
            points = np.empty(3 * len(thing.data.vertices))
            thing.data.vertices.foreach_get("co", points)
            matrix = np.array(thing.matrix_world)
            moved = points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
            found[thing.name] = {"faces": len(thing.data.polygons), "low": moved.min(axis=0).tolist(),
                                 "high": moved.max(axis=0).tolist()}
    return found


def _lights(scene: object) -> dict:
    found = {}
    for thing in scene.objects:
        if thing.type == "LIGHT":
            data, matrix = thing.data, np.array(thing.matrix_world)
            found[thing.name] = {
                "type": data.type, "position": matrix[:3, 3].tolist(), "direction": (-matrix[:3, 2]).tolist(),
                "energy": data.energy * _surface(data), "color": list(data.color),
                "radius": getattr(data, "shadow_soft_size", 0.0), "size": getattr(data, "size", 0.0),
                "cone": np.degrees(getattr(data, "spot_size", 0.0)) / 2}
    return found


def _surface(data: object) -> float:
    """Square metres that a lamp's energy is multiplied by, where it is not that of the whole lamp."""
    if data.normalize or data.type == "SUN":
        return 1.0
    if data.type == "AREA":
        return data.size * (data.size_y if data.shape in ("RECTANGLE", "ELLIPSE") else data.size)
    return 4 * np.pi * data.shadow_soft_size ** 2


def _camera(thing: object) -> dict:
    matrix = np.array(thing.matrix_world)
    return {"fov": float(np.degrees(thing.data.angle)), "position": matrix[:3, 3].tolist(),
            "direction": (-matrix[:3, 2]).tolist(), "up": matrix[:3, 1].tolist()}


def _world(world: object) -> list:
    """Radiance of an even sky."""
    background = world.node_tree.nodes["Background"].inputs
    return (np.array(background["Color"].default_value[:3]) * background["Strength"].default_value).tolist()


def main() -> None:
    """Answer until standard input ends; what Blender prints goes to standard error."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    threads, loaded = int(sys.argv[1]), None
    answers.write(json.dumps({"version": bpy.app.version_string}) + "\n")
    for line in sys.stdin:
        order = json.loads(line)
        if order["do"] == "open":
            order["path"] = str(Path(order["path"]).resolve())
            loaded, answer = opened(order, threads)
        else:
            answer = render(loaded, order)
        answers.write(json.dumps(answer) + "\n")


if __name__ == "__main__":
    main()
