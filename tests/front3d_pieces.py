"""Furniture of the house of `front3d_files`: procedural, and one piece that is no mirror image of itself."""

import functools
import io

import numpy as np
from PIL import Image

from dataset_builder.assets.procedural.furniture import make_furniture
from dataset_builder.spec.families import FAMILIES

LSHAPE = "aaaa0000-lshape"
PIECES = (
    ("sofa", "LivingDiningRoom-17", (2.0, 0, 0.7), 0, "Three-Seat / Multi-seat Sofa", "Sofa"),
    ("coffee_table", "LivingDiningRoom-17", (2.0, 0, 2.0), 0, "Coffee Table", "Table"),
    ("floor_lamp", "LivingDiningRoom-17", (4.4, 0, 0.6), 0, "Floor Lamp", "Lighting"),
    ("bookshelf", "LivingDiningRoom-17", (4.65, 0, 3.2), -90, "Bookcase / jewelry Armoire", "Cabinet/Shelf/Desk"),
    ("dining_table", "LivingDiningRoom-17", (1.25, 0, 5.6), 90, "Dining Table", "Table"),
    ("chair", "LivingDiningRoom-17", (0.5, 0, 4.4), 0, "Dining Chair", "Chair"),
    ("chair", "LivingDiningRoom-17", (2.0, 0, 4.4), 20, "Dining Chair", "Chair"),
    ("bed", "Bedroom-31", (7.0, 0, 1.3), 0, "King-size Bed", "Bed"),
    ("nightstand", "Bedroom-31", (5.5, 0, 0.5), 0, "Nightstand", "Cabinet/Shelf/Desk"),
    ("wardrobe", "Bedroom-31", (7.4, 0, 3.6), 180, None, "Cabinet/Shelf/Desk"),
    ("lshape", "Bedroom-31", (5.6, 0, 3.2), 0, "Corner/Side Table", "Table"),
    ("cabinet", "Kitchen-44", (3.4, 0, 6.6), 180, "Sideboard / Side Cabinet / Console", "Cabinet/Shelf/Desk"),
    ("stool", "Kitchen-44", (4.4, 0, 5.0), 0, "Barstool", "Pier/Stool"),
)
"""Model, room, place, degrees about +Y, category and the category above it in the list of models."""


def jid_of(model: str) -> str:
    """The folder of a model."""
    return LSHAPE if model == "lshape" else f"aaaa{list(FAMILIES).index(model):04d}-{model}"


@functools.cache
def model_files(model: str) -> tuple[dict[str, bytes], list[float]]:
    """Files of a model, its front along +Z, and its width, depth and height."""
    if model == "lshape":
        return lshape_files(), [0.6, 0.4, 0.5]
    family = FAMILIES[model]
    params = {each.name: float(round((each.low + each.high) / 2) if each.integer else (each.low + each.high) / 2)
              for each in family.params}
    asset = make_furniture(family=model, params=params, seed=7, name=model)
    positions = asset.mesh.positions @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    textured = next((each for each in asset.materials if each.texture is not None), None)
    libraries: list[str] = []
    lines = ["mtllib model.mtl", *(f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in positions)]
    lines += [f"vt {u:.6f} {v:.6f}" for u, v in asset.mesh.uvs.reshape(-1, 2)]
    for index, material in enumerate(asset.materials):
        red, green, blue = material.base_color if material is textured or material.texture is None else tuple(
            material.base_color * material.texture.base_color.mean(axis=(0, 1)))
        libraries.append(f"newmtl solid_{index}\nNs 20\nNi 1.5\nd 1.0\nTf 1 1 1\nillum 2\nKa 0.588 0.588 0.588\n"
                         f"Kd {red:.4f} {green:.4f} {blue:.4f}\nKs 0 0 0\nKe 0 0 0\n"
                         f"{'map_Kd ./texture.png' if material is textured else ''}\n")
        lines += [f"o solid_{index:03d}", f"usemtl solid_{index}"]
        lines += [f"f  {a + 1}/{3 * face + 1} {b + 1}/{3 * face + 2} {c + 1}/{3 * face + 3} "
                  for face, (a, b, c) in enumerate(asset.mesh.faces) if asset.mesh.material[face] == index]
    files = {"raw_model.obj": "\n".join(lines).encode(), "model.mtl": "\n".join(libraries).encode()}
    if textured is not None and textured.texture is not None:
        files["texture.png"] = png(255 * textured.texture.base_color ** (1 / 2.2))
    width, depth, height = asset.mesh.size
    return files, [round(width, 4), round(depth, 4), round(height, 4)]


def lshape_files(unit: float = 1.0) -> dict[str, bytes]:
    """A block of 0.6 x 0.2 x 0.4 m (x, y, z) with another of 0.2 x 0.3 x 0.4 m on its +X end. unit: per metre."""
    lines = ["mtllib model.mtl", "usemtl paint"]
    for index, (low, high) in enumerate((((-0.3, 0, -0.2), (0.3, 0.2, 0.2)), ((0.1, 0.2, -0.2), (0.3, 0.5, 0.2)))):
        lines += ["v {:.6f} {:.6f} {:.6f}".format(*(unit * np.where([n & 1, n & 2, n & 4], high, low)))
                  for n in range(8)]
        lines += ["f " + " ".join(str(v + 1 + 8 * index) for v in quad)
                  for quad in ((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6))]
    return {"raw_model.obj": "\n".join(lines).encode(), "model.mtl": b"newmtl paint\nKd 0.7 0.4 0.2\nillum 2\n"}


def png(texels: np.ndarray) -> bytes:
    """An image of values in [0, 255]."""
    stream = io.BytesIO()
    Image.fromarray(np.clip(texels, 0, 255).astype(np.uint8)).save(stream, "PNG")
    return stream.getvalue()
