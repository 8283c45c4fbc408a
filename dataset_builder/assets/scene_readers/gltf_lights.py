"""KHR_lights_punctual and cameras of a glTF file -> lights and cameras of a scene.

https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_lights_punctual; glTF 2.0, section 3.10.
"""

from collections.abc import Iterator
from math import atan, degrees, pi, tan

import numpy as np

from dataset_builder.assets.file_model import counted, of_each
from dataset_builder.assets.light_bounds import LEAST_BEAM
from dataset_builder.assets.readers.gltf_file import GltfFile
from dataset_builder.assets.readers.gltf_nodes import NodeTree
from dataset_builder.assets.readers.gltf_values import Entry
from dataset_builder.assets.scene_model import SceneCamera, SceneLight
from dataset_builder.label.scene_plan import LightPlan, Vector
from dataset_builder.light_kinds import LENGTHS, LIGHT_KINDS, LightName

LIGHTS = "KHR_lights_punctual"
LUMENS_PER_WATT = 683.0
"""Luminous efficacy at 555 nm, by which Blender's exporter goes from watts to glTF's lux and candela."""
KINDS: dict[str, LightName] = {"directional": "sun", "point": "point", "spot": "spot"}
BRIGHTEST = 1e12
"""Of lux or candela, in any channel."""
MOST_ASPECT = 100.0


def scene_lights(gltf: GltfFile, tree: NodeTree, paths: list[str],
                 world_from_file: np.ndarray) -> tuple[tuple[SceneLight, ...], list[str]]:
    """The lights that the scene shows, and what was decided about them. Raises UserError.

    Colours are linear Rec.709; lux and candela become W/m^2 and W/sr by `LUMENS_PER_WATT`. Where the file's unit is no
    metre, intensities grow with its square, so that the picture stays the same.
    """
    found, told = [], dict[str, list[str]]()
    unit = float(np.cbrt(np.linalg.det(world_from_file[:3, :3])))
    known = (gltf.root.extension(LIGHTS) or Entry({}, LIGHTS, gltf.path)).entries("lights")
    for number, world, entry in _drawn(gltf, tree, LIGHTS, "light", known):
        light, said = _light(entry, world_from_file @ world, unit)
        for word in said:
            told.setdefault(word, []).append(paths[number])
        if light is not None:
            found.append(SceneLight(name=paths[number], light=light))
    notes = [of_each("light", names, word) for word, names in told.items()]
    if found:
        notes.append(f"lights read at {LUMENS_PER_WATT:g} lm/W")
    return tuple(found), notes


def _drawn(gltf: GltfFile, tree: NodeTree, extension: str, key: str,
           known: list[Entry]) -> Iterator[tuple[int, np.ndarray, Entry]]:
    """Number, place and entry of every node with a light, or with a camera, that is there."""
    for number, node in enumerate(gltf.lists["nodes"]):
        place = node.extension(extension) if extension else node
        if place is not None and tree.is_drawn(number) and (index := place.index(key, known, f"{key}s")) is not None:
            yield number, tree.worlds[number], known[index]


def _light(entry: Entry, world: np.ndarray, unit: float) -> tuple[LightPlan | None, list[str]]:
    kind = entry.text("type")
    if kind not in KINDS:
        return None, [f"left out, being of a type {kind!r} that is not known"]
    color = np.clip(entry.numbers("color", (1, 1, 1)), 0, None) * max(entry.number("intensity", 1), 0)
    if not (color < BRIGHTEST).all():
        entry.refuse(f"expected less than {BRIGHTEST:g}, got {color.max():g}", key="intensity")
    notes = ["its range, as light has none"] if entry.has("range") else []
    spot = entry.entry("spot")
    outer = degrees(spot.number("outerConeAngle", pi / 4)) if kind == "spot" else 0.0
    inner = degrees(spot.number("innerConeAngle", 0)) if kind == "spot" else 0.0
    if kind == "spot" and not 0 <= inner < outer <= 90 + 1e-3:
        spot.refuse(f"expected 0 <= inner < outer <= 90 degrees, got {inner:g} and {outer:g}", key="outerConeAngle")
    if kind == "spot":
        notes.append("the smooth edge of its cone, which falls linearly here")
    factor = unit**LENGTHS[LIGHT_KINDS[KINDS[kind]].quantity] / LUMENS_PER_WATT
    return LightPlan(kind=KINDS[kind], position=(0, 0, 0) if kind == "directional" else _vector(world[:3, 3]),
                     direction=(0, 0, -1) if kind == "point" else _axis(entry, world, 2, -1), size=0,
                     cutoff=min(outer, 90.0), beam=max(inner, LEAST_BEAM) if kind == "spot" else 0.0, temperature=0,
                     weight=0, radiance=_vector(color * factor)), notes


def scene_cameras(gltf: GltfFile, tree: NodeTree, paths: list[str],
                  world_from_file: np.ndarray) -> tuple[tuple[SceneCamera, ...], list[str]]:
    """The perspective cameras that the scene shows, and what was left out or decided about them. Raises UserError."""
    found, notes, others = [], list[str](), 0
    for number, world, entry in _drawn(gltf, tree, "", "camera", gltf.lists["cameras"]):
        if entry.text("type") != "perspective":
            others += 1
            continue
        lens, place = entry.entry("perspective"), world_from_file @ world
        height, aspect = lens.number("yfov", 0), lens.number("aspectRatio", 1)
        if not 0 < height < pi or not 0 < aspect < MOST_ASPECT:
            lens.refuse(f"expected a yfov in (0, pi) and an aspectRatio in (0, {MOST_ASPECT:g}), got {height:g} and "
                        f"{aspect:g}")
        if not lens.has("aspectRatio"):
            notes.append(f"camera {paths[number]}: no aspectRatio, taken as square")
        position, ahead = place[:3, 3], np.array(_axis(entry, place, 2, -1))
        found.append(SceneCamera(name=paths[number], position=_vector(position), target=_vector(position + ahead),
                                 up=_axis(entry, place, 1, 1), fov=degrees(2 * atan(aspect * tan(height / 2)))))
    notes += [f"{counted(others, 'camera')} without perspective"] if others else []
    return tuple(found), notes


def _axis(entry: Entry, world: np.ndarray, axis: int, sign: int) -> Vector:
    """Unit vector along an axis of a node. Raises UserError where its matrix leaves none."""
    along = sign * world[:3, axis]
    length = float(np.linalg.norm(along))
    if not 0 < length < np.inf:
        entry.refuse("expected a node whose matrix keeps its axes, got one scaled to nothing or to infinity")
    return _vector(along / length)


def _vector(values: np.ndarray) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
