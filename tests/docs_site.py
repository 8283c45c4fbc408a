"""Files that the pages take for granted: models, houses and a flat, as a reader would have them."""

import json
from pathlib import Path

import numpy as np
import trimesh

from tests.assets.gltf_files import glb
from tests.assets.splat_files import ball
from tests.assets.splat_files import write_ply as write_splat_ply
from tests.capture_files import Made, orbit, tilted
from tests.front3d_files import house
from tests.gltf_scenes import ROOM, at, thing, write_gltf


def write_teapot(site: Path, texts: list[str]) -> None:
    """A mesh with its spec and a dataset: the `texts` of the page."""
    objects = site / "teapots" / "objects"
    objects.mkdir(parents=True)
    trimesh.creation.box(extents=(40, 30, 20)).export(objects / "teapot.glb")
    (objects / "teapot.yaml").write_text(texts[0])
    (site / "teapots" / "teapots.yaml").write_text(texts[1])


def write_models(site: Path) -> None:
    """A folder of models to import."""
    (site / "models").mkdir()
    for name, extents in (("chair", (0.5, 0.9, 0.5)), ("table", (1.2, 0.8, 0.7))):
        trimesh.creation.box(extents=extents).export(site / "models" / f"{name}.glb")


def write_photographs(site: Path) -> None:
    """A capture as COLMAP leaves it, with masks."""
    Made(poses=orbit(16), size=(48, 48), focal=72.0, turn=tilted(), scale=3.0).write_colmap(site / "photographs")


def write_splats(site: Path) -> None:
    """A capture as Gaussian splats."""
    (site / "splats").mkdir()
    write_splat_ply(site / "splats" / "vase.ply", ball(600, degree=1))


def write_houses(site: Path) -> None:
    """Folders as those of 3D-FRONT and 3D-FUTURE, with two houses."""
    made = house()
    made.write(site / "downloads")
    for kind, name in (("models", "3D-FUTURE-model"), ("textures", "3D-FRONT-texture")):
        (site / "downloads" / kind).rename(site / name)
    (site / "3D-FRONT").mkdir()
    for uid in ("one", "two"):
        (site / "3D-FRONT" / f"{uid}.json").write_text(json.dumps({**made.document, "uid": uid}))


def write_flat(folder: Path, texts: list[str]) -> None:
    """A flat with furniture, lamps and a camera of its own, its spec and a dataset: the `texts` of the page."""
    roof = [thing("RoofLeft", at(-1, 0, 2.5, (2, 4, 0.1))), thing("RoofRight", at(1, 0, 2.5, (2, 4, 0.1)))]
    things = [*ROOM, thing("Wall_right", at(2.05, 0, 0, (0.1, 4, 2.5)), (0.7, 0.7, 0.7)),
              thing("Chair_01", at(-0.7, 0.2, 0, (0.5, 0.5, 0.9), 30), (0.7, 0.2, 0.1)),
              thing("Chair_02", at(0.8, -0.4, 0, (0.5, 0.5, 0.9), 200), (0.2, 0.3, 0.7)),
              thing("FloorLamp", at(1.5, 1.5, 0, (0.2, 0.2, 1.4))),
              thing("WallClock", at(0.5, 1.97, 1.6, (0.3, 0.05, 0.3)), (0.1, 0.1, 0.1)), *roof]
    folder.mkdir()
    file = write_gltf(folder / "flat.gltf", things)
    document = json.loads(file.read_text())
    file.unlink()
    nodes = document["nodes"]
    lamps = [{"type": "point", "intensity": 120.0}, {"type": "point", "intensity": 40.0},
             {"type": "spot", "intensity": 300.0, "spot": {"outerConeAngle": 0.8}}]
    for number, (name, place) in enumerate((("Ceiling", (0, 2.2, 0)), ("Desk", (1.2, 1.6, 1.2)),
                                            ("Spot_1", (-1, 2.2, 0.5)))):
        down = np.array([np.sin(-np.pi / 4), 0, 0, np.cos(np.pi / 4)]).tolist()
        nodes.append({"name": name, "translation": place, "rotation": down,
                      "extensions": {"KHR_lights_punctual": {"light": number}}})
    nodes.append({"name": "Camera", "camera": 0, "translation": (0, 1.3, 2.4)})
    nodes.append({"name": "Room", "children": list(range(len(nodes)))})
    document |= {"scenes": [{"nodes": [len(nodes) - 1]}], "extensionsUsed": ["KHR_lights_punctual"],
                 "extensions": {"KHR_lights_punctual": {"lights": lamps}},
                 "cameras": [{"type": "perspective", "perspective": {"yfov": 1.0, "aspectRatio": 1.2, "znear": 0.1}}]}
    (folder / "flat.glb").write_bytes(glb(document, None))
    (folder / "flat.yaml").write_text(texts[0])
    (folder / "house.yaml").write_text(texts[1])
