"""CPU seconds and memory of a house of hundreds of pieces and millions of triangles: read, planned, and rendered.

The house is written as one GLB: four rooms in a row with doors and windows, and bumpy balls on legs, each with a mesh
and a picture of its own, as in scanned flats. Each size runs in a process of its own, whose peak of memory counts. The
kernels of its passes are compiled first, on a small house, so that times are those of every later view.
"""

import argparse
import io
import json
import resource
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from PIL import Image

from benchmarks.large_mesh import scan
from dataset_builder.planning.plan import Planner, plan_example
from dataset_builder.rendering import plugins
from dataset_builder.rendering.backend import activate
from dataset_builder.rendering.examples import render_view
from dataset_builder.seeding import rng
from dataset_builder.spec.load import load_dataset

SIZES = ((8, 20_000, 4), (300, 2_000_000, 300))
"""Pieces, triangles and pictures; the first warms up."""
ROOMS, WIDTH, DEPTH, HEIGHT, WALL = 4, 8.0, 8.0, 2.7, 0.1
TEXELS = 512
MEBIBYTE = 1 << 20
SPEC = """
name: large-house
seed: 1
image: {width: 128, height: 128}
layers: {i_s: frame, i_t: frame, d: object, r: object, s_prime: object, mask: object}
render: {spp: 4}
target: {kinds: [area], distance: {uniform: [0.8, 1.6]}}
splits:
  - name: train
    objects: {things: {name: "*piece*"}, count: 2}
    scenes: {from: [scene.yaml], count: 1}
    views: 2
"""


Corner = tuple[float, float, float]
Thing = tuple[str, np.ndarray, np.ndarray, np.ndarray, int]
"""Name, (V, 3) positions in metres with Z up, (F, 3) faces, (V, 2) texture coordinates, and 0 for plaster or the number
of a picture."""


def write_house(path: Path, pieces: int, triangles: int, pictures: int) -> None:
    """The house as a GLB; metres, Y up."""
    things = [(name, positions, faces, positions[:, :2], 0)
              for name, positions, faces in (box_mesh(*part) for part in building(ROOMS, WIDTH, DEPTH))]
    draws, places = rng(0, "house"), ROOMS * 10
    positions, faces, uvs = ball(triangles // pieces)
    for number in range(pieces):
        shape = positions * draws.uniform(0.2, 0.35, 3) * (1 + 0.05 * np.sin(draws.uniform(3, 9) * positions[:, :1]))
        row, column = divmod(number, places)
        spot = np.array([column * WIDTH / 10 + WIDTH / 20, 0.6 + row * (DEPTH - 1.2) / max(-(-pieces // places), 1), 0])
        things.append((f"piece_{number:03d}", shape + spot - [0, 0, shape[:, 2].min()], faces, uvs,
                       1 + number % pictures))
    write_glb(path, things, [picture(number) for number in range(pictures)])


def ball(triangles: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, faces and texture coordinates of a bumpy ball of radius 1."""
    raw = scan(triangles)
    positions, index = np.unique(raw.positions, axis=0, return_inverse=True)
    uvs = np.stack([np.arctan2(positions[:, 1], positions[:, 0]) / np.pi, positions[:, 2]], 1)
    return positions, index.reshape(-1)[raw.faces], uvs


def write_glb(path: Path, things: Sequence[Thing], pictures: Sequence[bytes]) -> None:
    """Things as nodes of a GLB, Y up, each with a mesh of its own."""
    binary, views, accessors, meshes, nodes = io.BytesIO(), [], [], [], []

    def view(data: bytes) -> int:
        binary.write(b"\0" * (-binary.tell() % 4))
        views.append({"buffer": 0, "byteOffset": binary.tell(), "byteLength": len(data)})
        binary.write(data)
        return len(views) - 1

    def accessor(values: np.ndarray, kind: str) -> int:
        accessors.append({"bufferView": view(values.tobytes()), "componentType": 5125 if kind == "SCALAR" else 5126,
                          "count": len(values), "type": kind,
                          **({} if kind == "SCALAR" else {"min": values.min(0).tolist(),
                                                          "max": values.max(0).tolist()})})
        return len(accessors) - 1

    images = [{"bufferView": view(each), "mimeType": "image/png"} for each in pictures]
    for name, positions, faces, uvs, material in things:
        flat = np.ascontiguousarray(positions @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], dtype=float), np.float32)
        attributes = {"POSITION": accessor(flat, "VEC3"), "TEXCOORD_0": accessor(uvs.astype(np.float32), "VEC2")}
        meshes.append({"primitives": [{"attributes": attributes, "material": material,
                                       "indices": accessor(faces.astype(np.uint32).ravel(), "SCALAR")}]})
        nodes.append({"name": name, "mesh": len(meshes) - 1})
    materials = [{"name": "plaster", "pbrMetallicRoughness": {"metallicFactor": 0}}, *(
        {"name": f"cloth {k}", "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": {"index": k}}}
        for k in range(len(pictures)))]
    nodes.append({"name": "house", "children": list(range(len(nodes)))})
    head = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [len(nodes) - 1]}], "nodes": nodes,
            "meshes": meshes, "materials": materials, "textures": [{"source": k} for k in range(len(pictures))],
            "images": images, "accessors": accessors, "bufferViews": views,
            "buffers": [{"byteLength": binary.tell()}]}
    text = json.dumps(head).encode()
    text += b" " * (-len(text) % 4)
    body = binary.getvalue() + b"\0" * (-binary.tell() % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def picture(number: int) -> bytes:
    draws = rng(number, "picture")
    coarse = draws.integers(60, 230, (16, 16, 3), dtype=np.uint8)
    stream = io.BytesIO()
    Image.fromarray(np.kron(coarse, np.ones((TEXELS // 16, TEXELS // 16, 1), np.uint8))).save(stream, "PNG")
    return stream.getvalue()


def building(rooms: int, width: float, depth: float) -> list[tuple[str, Corner, Corner]]:
    """Names and corners of boxes: floor, ceiling, outer walls with a window each, inner walls with a door each."""
    length = rooms * width
    parts = [("floor", (0, 0, -0.2), (length, depth, 0)),
             ("ceiling", (0, 0, HEIGHT), (length, depth, HEIGHT + 0.2)),
             ("wall_east", (-WALL, 0, 0), (0, depth, HEIGHT)),
             ("wall_west", (length, 0, 0), (length + WALL, depth, HEIGHT)),
             ("wall_front", (0, -WALL, 0), (length, 0, HEIGHT)),
             ("wall_back_low", (0, depth, 0), (length, depth + WALL, 0.9)),
             ("wall_back_high", (0, depth, 2.2), (length, depth + WALL, HEIGHT))]
    for room in range(rooms):
        x = room * width
        parts.append((f"wall_pier_{room}", (x, depth, 0.9), (x + width / 2, depth + WALL, 2.2)))
        if room:
            parts += [(f"wall_inner_{room}a", (x, 0, 0), (x + WALL, depth / 2, HEIGHT)),
                      (f"wall_inner_{room}b", (x, depth / 2 + 0.9, 0), (x + WALL, depth, HEIGHT)),
                      (f"wall_lintel_{room}", (x, depth / 2, 2.1), (x + WALL, depth / 2 + 0.9, HEIGHT))]
    return parts


def box_mesh(name: str, low: Corner, high: Corner) -> tuple[str, np.ndarray, np.ndarray]:
    corners = np.array([(x, y, z) for z in (low[2], high[2]) for y in (low[1], high[1]) for x in (low[0], high[0])])
    faces = np.array([(0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4), (2, 6, 7), (2, 7, 3),
                      (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5)])
    return name, corners, faces


def measure(folder: Path, pieces: int, triangles: int, pictures: int) -> dict[str, float]:
    """CPU seconds by step, and the peak of memory after it in mebibytes."""
    found: dict[str, float] = {}

    def step(name: str, work: Callable[[], Any]) -> Any:
        begin = process_time()
        result = work()
        found[name] = process_time() - begin
        found[f"{name} MiB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / MEBIBYTE
        return result

    write_house(folder / "house.glb", pieces, triangles, pictures)
    (folder / "set.yaml").write_text(SPEC)
    (folder / "scene.yaml").write_text("file: {path: house.glb, licence: CC0-1.0}\n")
    found["GLB MiB"] = (folder / "house.glb").stat().st_size / MEBIBYTE
    activate("auto", 0)
    plugins.register()
    loaded = step("spec", lambda: load_dataset(folder / "set.yaml"))
    planner = Planner(loaded)
    first = step("first plan", lambda: plan_example(loaded, 0, planner))
    step("same view, planned anew", lambda: plan_example(loaded, 0, planner))
    step("another view or thing", lambda: plan_example(loaded, 1, planner))
    step("rendered", lambda: list(render_view([first], folder)))
    return found


def apart(*size: int) -> dict[str, float]:
    """`measure` in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.large_house", "--measure", *map(str, size)]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()[-1])


def main() -> None:
    """Print the figures of every size."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--measure", type=int, nargs=3, metavar=("PIECES", "TRIANGLES", "PICTURES"))
    options = parser.parse_args()
    if options.measure:
        with tempfile.TemporaryDirectory() as folder:
            print(json.dumps(measure(Path(folder), *options.measure)))
        return
    results = [apart(*size) for size in SIZES]
    for name in results[-1]:
        print(f"{name:30} " + " ".join(f"{result[name]:10.2f}" for result in results))


if __name__ == "__main__":
    main()
