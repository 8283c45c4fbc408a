"""A house in the schema of 3D-FRONT, made in code: three rooms, one L-shaped, with doors, windows and furniture.

Axes are the format's: metres, Y up. Nothing of it comes from the data set; all ids are invented.
"""

import copy
import functools
import json
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from dataset_builder.label.scene_source import SceneSource
from tests.front3d_pieces import PIECES, jid_of, model_files, png

HEIGHT, WALL = 2.8, 0.12
"""Of rooms, and the thickness of walls, metres."""
ROOMS = {
    "LivingDiningRoom-17": ((0, 0), (5, 0), (5, 4), (2.5, 4), (2.5, 7), (0, 7)),
    "Bedroom-31": ((5, 0), (9, 0), (9, 4), (5, 4)),
    "Kitchen-44": ((2.5, 4), (5, 4), (5, 7), (2.5, 7)),
}
"""Middle lines of the walls around each room, x and z."""
FLOORS = {
    "LivingDiningRoom-17": (((0.06, 0.06), (4.94, 3.94)), ((0.06, 3.94), (2.44, 6.94))),
    "Bedroom-31": (((5.06, 0.06), (8.94, 3.94)),),
    "Kitchen-44": (((2.56, 4.06), (4.94, 6.94)),),
}
"""Rectangles between the walls, a mesh each."""
DOORS = {((5, 1.5), (5, 2.4)): (0, 2.1), ((3.2, 4), (4.1, 4)): (0, 2.1), ((0, 5), (0, 5.9)): (0, 2.1)}
WINDOWS = {((1, 0), (3.5, 0)): (0.9, 2.3), ((9, 1), (9, 3)): (0.9, 2.3), ((3, 7), (4.5, 7)): (1.0, 2.2)}
"""Openings: ends on the wall's middle line, and heights."""


@dataclass
class House:
    """A house before it is written, for tests to break."""

    document: dict[str, Any]
    files: dict[str, bytes]
    """Models and textures by path, such as `models/JID/raw_model.obj`."""
    models: list[dict[str, Any]]
    """The list of models."""

    def entry(self, model: str) -> dict[str, Any]:
        """The entry of a model in the list of furniture."""
        return next(each for each in self.document["furniture"] if each["jid"] == jid_of(model))

    def room(self, name: str) -> dict[str, Any]:
        return next(each for each in self.document["scene"]["room"] if each["instanceid"] == name)

    def child(self, model: str) -> dict[str, Any]:
        """The first place of a model."""
        uid = self.entry(model)["uid"]
        return next(child for room in self.document["scene"]["room"] for child in room["children"]
                    if child["ref"] == uid)

    def mesh(self, kind: str, number: int = 0) -> dict[str, Any]:
        return [each for each in self.document["mesh"] if each["type"] == kind][number]

    def material(self, uid: str) -> dict[str, Any]:
        return next(each for each in self.document["material"] if each["uid"] == uid)

    def write(self, folder: Path) -> SceneSource:
        """All files, and how they are named in a spec of that folder."""
        files = {**self.files, "models/model_info.json": json.dumps(self.models).encode(),
                 "house.json": json.dumps(self.document).encode()}
        (folder / "textures").mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content)
        return SceneSource(source="house.json", licence="CC0-1.0", models="models", textures="textures")


def house(*, rooms: tuple[str, ...] = tuple(ROOMS), models: tuple[str, ...] = ()) -> House:
    """A house without faults, a copy of its own: of these rooms, with furniture of these models or of all."""
    return copy.deepcopy(_house(rooms, models))


@functools.cache
def _house(rooms: tuple[str, ...], models: tuple[str, ...]) -> House:
    made = House({"uid": "aaaa-house", "design_version": "0.1", "code_version": "0.4", "north_vector": [0, 1, 0],
                  "furniture": [], "mesh": [], "material": [], "extension": {
                      "door": [], "outdoor": "", "pano": {}, "mini_map": "", "perspective_view": {"link": []},
                      "area": []},
                  "scene": {"ref": "-1", **still(), "room": []}, "version": "2.0"}, {}, [])
    for uid, color, jid in (("wood", [180, 140, 100, 255], "bbbb-wood"), ("plaster", [235, 232, 225, 255], ""),
                            ("white", [245, 245, 245, 255], "local"), ("blue", [90, 120, 160, 255], "")):
        made.document["material"].append({"uid": uid, "aid": [], "jid": jid, "texture": "", "normaltexture": "",
                                          "color": color})
    made.document["material"][0]["UVTransform"] = [0.5, 0, 0, 0, 0.5, 0, 0, 0, 1]
    made.files["textures/bbbb-wood/texture.png"] = _planks()
    for name in rooms:
        made.document["scene"]["room"].append({"type": name.split("-")[0], "instanceid": name, **still(),
                                               "children": []})
        _build(made, name)
    for opening, heights in DOORS.items():
        uid = _line(made, "Door", opening, heights)
        made.document["extension"]["door"].append({"type": "interiorDoor", "roomId": next(iter(ROOMS)),
                                                   "dir": "outerLeft", "ref": [uid]})
    for opening, heights in WINDOWS.items():
        _line(made, "Window", opening, heights)
    for model, room, place, turn, category, above in PIECES:
        if room in rooms and (not models or model in models):
            _furnish(made, model, room, place, turn, (category, above))
    return made


def still() -> dict[str, list[float]]:
    """A placement that changes nothing."""
    return {"pos": [0, 0, 0], "rot": [0, 0, 0, 1], "scale": [1, 1, 1]}


def turned(degrees: float) -> list[float]:
    """Quaternion about +Y, with the five digits of the format."""
    half = np.radians(degrees) / 2
    return [0, round(float(np.sin(half)), 5), 0, round(float(np.cos(half)), 5)]


def _planks() -> bytes:
    rows = 150 + 40 * (np.arange(64) // 16 % 2)[:, None] + 10 * np.sin(np.arange(64) / 3)[None]
    return png(rows[..., None] * [1, 0.75, 0.5])


# The building

def _build(made: House, room: str) -> None:
    """Floors, ceilings, and walls with openings that face the room."""
    for (x0, z0), (x1, z1) in FLOORS[room]:
        flat = [[x0, 0, z0], [x1, 0, z0], [x1, 0, z1], [x0, 0, z1]]
        add_mesh(made, room, "Floor", [flat], (0, 1, 0), "wood")
        add_mesh(made, room, "Ceiling", [[[x, HEIGHT, z] for x, _, z in flat]], (0, -1, 0), "white")
    corners = np.array(ROOMS[room], dtype=float)
    along = np.roll(corners, -1, axis=0) - corners
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    inward = np.stack([-along[:, 1], along[:, 0]], axis=1)
    inner = corners + WALL / 2 * (inward + np.roll(inward, 1, axis=0))
    for number, (start, end) in enumerate(zip(inner, np.roll(inner, -1, axis=0), strict=True)):
        (nx, nz), quads = inward[number], _wall(start, end, along[number])
        behind = np.array([nx, 0, nz]) * WALL / 4
        add_mesh(made, room, "WallInner", quads, (nx, 0, nz), "plaster")
        add_mesh(made, room, "WallOuter", [quad - behind for quad in quads], (-nx, 0, -nz), "plaster")
        top = [[*start], [*end], [*(end - inward[number] * WALL / 4)], [*(start - inward[number] * WALL / 4)]]
        add_mesh(made, room, "WallTop", [[[x, HEIGHT, z] for x, z in top]], (0, 1, 0), "plaster")
    (x0, z0), (x1, _) = inner[0], inner[1]
    for kind, low, high in (("Baseboard", 0.0, 0.08), ("Cornice", HEIGHT - 0.1, HEIGHT)):
        add_mesh(made, room, kind, [[[x0, low, z0 + 0.01], [x1, low, z0 + 0.01], [x1, high, z0 + 0.01],
                                     [x0, high, z0 + 0.01]]], (0, 0, 1), "white")


def _wall(start: np.ndarray, end: np.ndarray, along: np.ndarray) -> list[np.ndarray]:
    """(4, 3) corners of the rectangles of a wall's inner side, which leave openings free."""
    length = float(np.linalg.norm(end - start))
    holes = []
    for (one, other), (low, high) in {**DOORS, **WINDOWS}.items():
        places = [np.array(point, dtype=float) - start for point in (one, other)]
        if all(abs(along[0] * p[1] - along[1] * p[0]) < WALL and 0 <= p @ along <= length for p in places):
            holes.append((*sorted(float(p @ along) for p in places), low, high))
    across = sorted({0.0, length, *(s for hole in holes for s in hole[:2])})
    up = sorted({0.0, HEIGHT, *(y for hole in holes for y in hole[2:])})
    quads = []
    for s0, s1 in pairwise(across):
        for y0, y1 in pairwise(up):
            s, y = (s0 + s1) / 2, (y0 + y1) / 2
            if not any(a < s < b and low < y < high for a, b, low, high in holes):
                (x0, z0), (x1, z1) = start + along * s0, start + along * s1
                quads.append(np.array([[x0, y0, z0], [x1, y0, z1], [x1, y1, z1], [x0, y1, z0]]))
    return quads


def _line(made: House, kind: str, opening: Any, heights: tuple[float, float]) -> str:
    """The four sides of an opening between the faces of its wall; the uid of the mesh."""
    one, other = (np.array(point, dtype=float) for point in opening)
    along = (other - one) / np.linalg.norm(other - one)
    deep, (low, high) = np.array([-along[1], along[0]]) * WALL / 2, heights
    (ax, az), (bx, bz), (cx, cz), (dx, dz) = one - deep, one + deep, other + deep, other - deep
    quads = [[[ax, low, az], [bx, low, bz], [bx, high, bz], [ax, high, az]],
             [[cx, low, cz], [dx, low, dz], [dx, high, dz], [cx, high, cz]],
             [[ax, high, az], [bx, high, bz], [cx, high, cz], [dx, high, dz]],
             [[ax, low, az], [bx, low, bz], [cx, low, cz], [dx, low, dz]]]
    for quad, normal in zip(quads, ((along[0], 0, along[1]), (-along[0], 0, -along[1]), (0, -1, 0), (0, 1, 0)),
                            strict=True):
        add_mesh(made, made.document["scene"]["room"][0]["instanceid"], kind, [quad], normal, "white")
    return made.document["mesh"][-1]["uid"]


def add_mesh(made: House, room: str, kind: str, quads: list[Any], normal: tuple[float, ...], material: str) -> None:
    """A mesh of rectangles that face along `normal`, without shared vertices, and its child of a room."""
    points: list[np.ndarray] = []
    for quad in quads:
        a, b, c, d = np.array(quad, dtype=float)
        points += (a, b, c, a, c, d) if np.cross(b - a, c - a) @ normal > 0 else (a, c, b, a, d, c)
    texture = [(p[0], p[2]) if abs(normal[1]) > 0.5 else (p[0] + p[2], p[1]) for p in points]
    number = len(made.document["mesh"])
    made.document["mesh"].append({
        "uid": f"{number}/mesh", "jid": "", "aid": [], "xyz": np.round(points, 5).ravel().tolist(),
        "normal": np.round(np.array(points) + normal, 5).ravel().tolist(), "uv": np.round(texture, 5).ravel().tolist(),
        "faces": list(range(len(points))), "material": material, "type": kind})
    made.room(room)["children"].append({"ref": f"{number}/mesh", **still(), "instanceid": f"mesh/{number}"})


def _furnish(made: House, model: str, room: str, place: tuple[float, ...], turn: float,
             categories: tuple[str | None, str]) -> None:
    jid = jid_of(model)
    if not any(entry["jid"] == jid for entry in made.document["furniture"]):
        files, size = model_files(model)
        made.files.update({f"models/{jid}/{name}": content for name, content in files.items()})
        made.document["furniture"].append({
            "uid": f"{len(made.document['furniture'])}/model", "jid": jid, "aid": [], "size": size,
            "sourceCategoryId": "", "title": "", "category": categories[0] or categories[1], "bbox": size,
            "valid": True})
        made.models.append({"model_id": jid, "super-category": categories[1], "category": categories[0],
                            "style": None, "theme": None, "material": None})
    children = made.room(room)["children"]
    children.append({"ref": made.entry(model)["uid"], "pos": list(place), "rot": turned(turn), "scale": [1, 1, 1],
                     "instanceid": f"furniture/{len(children)}"})
