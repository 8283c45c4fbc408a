"""Kernels that scenes of different origin need: procedural rooms, GLB, OBJ, STL, USD and 3D-FRONT in one process.

Every scene is rendered tiny, with the same effects and lights of the same kinds; the large kernels of each are listed.
"""

import argparse
import json
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.large_house import Thing, ball, box_mesh, building, picture, write_glb
from dataset_builder.planning.plan import Planner, plan_example
from dataset_builder.rendering import plugins
from dataset_builder.rendering.backend import activate
from dataset_builder.rendering.examples import render_view
from dataset_builder.seeding import rng
from dataset_builder.spec.load import load_dataset

SCENES = 4
"""Of each origin."""
LARGE = 1000
"""Operations from which a kernel is one that traces paths."""
FEATURES = ("specular", "textures")
SPEC = """
name: kernels
seed: 1
image: {{width: 16, height: 12}}
layers: {{i_s: frame, i_t: frame, d: object, r: object, s_prime: object, mask: object}}
render: {{spp: 4, max_depth: 4}}
rough: {{sigma: [0.005], edge_length: 0.3, rounds: 0}}
camera: {{coverage: [0.02, 0.6]}}
target: {{kinds: [area], distance: {{uniform: [0.8, 1.6]}}}}
splits:
  - name: train
    objects: {objects}
    scenes: {{from: [scene.yaml], count: 1}}
"""
THINGS = '{things: {name: "*piece*"}, count: 1}'


def house(number: int) -> list[Thing]:
    """A room with three pieces; another number, another size."""
    draws = rng(number, "kernels")
    width, depth = draws.uniform(4, 6, 2)
    boxes = (box_mesh(*part) for part in building(1, width, depth))
    things = [(name, positions, faces, positions[:, :2], 0) for name, positions, faces in boxes]
    positions, faces, uvs = ball(500 + 100 * number)
    for piece in range(3):
        shape = positions * draws.uniform(0.2, 0.3, 3)
        spot = [width * (piece + 1) / 4, depth * draws.uniform(0.4, 0.6), -shape[:, 2].min()]
        things.append((f"piece_{piece}", shape + spot, faces, uvs, 1))
    return things


def procedural(folder: Path, number: int) -> str:
    """A room in code with an object in it; the spec's objects."""
    (folder / "room.yaml").write_text(f"width: {4 + number / 4}\ndepth: 4\nheight: 2.5\nwindows: 1\n")
    (folder / "scene.yaml").write_text("room: room.yaml\n")
    (folder / "object.yaml").write_text(f"family: {('cabinet', 'chair', 'ottoman', 'desk')[number % 4]}\n")
    return "{from: [object.yaml], count: 1}"


def glb(folder: Path, number: int) -> str:
    """A GLB with pictures of another size each."""
    write_glb(folder / "house.glb", house(number), [picture(number)])
    return _file_scene(folder, "house.glb")


def obj(folder: Path, number: int) -> str:
    """An .obj with an object for each thing."""
    (folder / "paint.png").write_bytes(picture(number))
    (folder / "house.mtl").write_text("newmtl plaster\nKd 0.7 0.7 0.7\nnewmtl cloth\nKd 1 1 1\nmap_Kd paint.png\n")
    lines, first = ["mtllib house.mtl"], 1
    for name, positions, faces, uvs, material in house(number):
        lines += [f"o {name}", f"usemtl {'cloth' if material else 'plaster'}"]
        lines += [f"v {x:.5f} {z:.5f} {-y:.5f}" for x, y, z in positions]
        lines += [f"vt {u:.5f} {v:.5f}" for u, v in uvs]
        lines += ["f " + " ".join(f"{corner}/{corner}" for corner in face) for face in (faces + first).tolist()]
        first += len(positions)
    (folder / "house.obj").write_text("\n".join(lines))
    return _file_scene(folder, "house.obj")


def usd(folder: Path, number: int) -> str:
    """A stage of text, Z up, in metres."""
    lines = ['#usda 1.0', '(', 'defaultPrim = "House"', 'metersPerUnit = 1', 'upAxis = "Z"', ')',
             'def Xform "House"', '{']
    for name, positions, faces, *_ in house(number):
        points = ", ".join(f"({x:.5f}, {y:.5f}, {z:.5f})" for x, y, z in positions)
        lines += [f'def Mesh "{name}"', '{', 'uniform token subdivisionScheme = "none"',
                  f"point3f[] points = [{points}]", f"int[] faceVertexCounts = {[3] * len(faces)}",
                  f"int[] faceVertexIndices = {faces.ravel().tolist()}", "}"]
    (folder / "house.usda").write_text("\n".join([*lines, "}"]))
    return _file_scene(folder, "house.usda")


def front3d(folder: Path, number: int) -> str:
    """A house in the schema of 3D-FRONT: its building as meshes, its pieces as models under invented ids."""
    still = {"pos": [0, 0, 0], "rot": [0, 0, 0, 1], "scale": [1, 1, 1]}
    meshes, furniture, children = [], [], []
    for name, positions, faces, uvs, material in house(number):
        upright = positions @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], dtype=float)
        if not material:
            kind = {"floor": "Floor", "ceiling": "Ceiling"}.get(name, "WallInner")
            meshes.append({"uid": name, "jid": "", "xyz": upright[faces].ravel().tolist(), "normal": [],
                           "uv": uvs[faces].ravel().tolist(), "faces": list(range(faces.size)), "material": "plaster",
                           "type": kind, "aid": []})
        else:
            model = folder / "models" / f"0000-{name}"
            model.mkdir(parents=True)
            (model / "raw_model.obj").write_text("\n".join(
                [*(f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in upright),
                 *("f " + " ".join(map(str, face)) for face in (faces + 1).tolist())]))
            furniture.append({"uid": name, "jid": model.name, "aid": [], "size": np.ptp(upright, axis=0).tolist(),
                              "sourceCategoryId": "", "title": "", "category": "stool", "valid": True})
        children.append({"ref": name, "instanceid": f"piece/{name}", **still})
    room = {"type": "Bedroom", "instanceid": "Bedroom-1", **still, "children": children}
    (folder / "house.json").write_text(json.dumps({
        "uid": "0000-house", "furniture": furniture, "mesh": meshes, "extension": {"door": [], "area": []},
        "material": [{"uid": "plaster", "jid": "", "texture": "", "normaltexture": "", "color": [230, 230, 225, 255]}],
        "scene": {"ref": "-1", **still, "room": [room]}, "version": "2.0"}))
    return _file_scene(folder, "house.json", ", models: models")


def _file_scene(folder: Path, name: str, more: str = "") -> str:
    (folder / "scene.yaml").write_text(f"file: {{path: {name}, licence: CC0-1.0{more}}}\n")
    return THINGS


ORIGINS: dict[str, Callable[[Path, int], str]] = {
    "procedural": procedural, "GLB": glb, "OBJ": obj, "USD": usd, "3D-FRONT": front3d}
"""What writes a scene into an empty folder and returns the objects of its dataset spec."""


def kernels_of(origin: str, number: int, folder: Path) -> frozenset[str]:
    """Hashes of the large kernels that a scene needs, by its effects alone: those of `FEATURES`."""
    import drjit as dr

    objects = ORIGINS[origin](folder, number)
    (folder / "set.yaml").write_text(SPEC.format(objects=objects))
    loaded = load_dataset(folder / "set.yaml")
    plan = plan_example(loaded, 0, Planner(loaded))
    plan = plan.model_copy(update={"effects": plan.effects.model_copy(update={"features": FEATURES})})
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        list(render_view([plan], folder))
        return frozenset(kernel["hash"] for kernel in dr.kernel_history() if kernel.get("operation_count", 0) > LARGE)


def kernels(origins: Sequence[str], scenes: int) -> dict[tuple[str, int], frozenset[str]]:
    """The large kernels of every scene, all rendered in this process."""
    found = {}
    for origin in origins:
        for number in range(scenes):
            with tempfile.TemporaryDirectory() as folder:
                found[origin, number] = kernels_of(origin, number, Path(folder))
    return found


def main() -> None:
    """Print how many kernels each scene needs, and how many of these procedural rooms do not."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=SCENES, help="of each origin")
    options = parser.parse_args()
    activate("auto", 0)
    plugins.register()
    found, known = kernels(list(ORIGINS), options.scenes), set[str]()
    for (origin, number), own in found.items():
        print(f"{origin:12} {number:3} {len(own):4} kernels, {len(own - known):2} new")
        known |= own
    print(f"{len(found)} scenes, {len(known)} kernels")


if __name__ == "__main__":
    main()
