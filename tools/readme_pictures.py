"""Make the pictures of the README again: `python tools/readme_pictures.py [FOLDER]`, about ten minutes on two cores.

Each picture is a few examples of the mini dataset, planned and rendered with other values; nothing of it is retouched.
"""

import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from dataset_builder.layers import LAYERS
from dataset_builder.planning.plan import Planner
from dataset_builder.processes import cores
from dataset_builder.rendering.backend import activate
from dataset_builder.rendering.examples import render_view
from dataset_builder.report.dataset_summary import cell_pixels
from dataset_builder.spec.load import load_dataset
from dataset_builder.tonemap import exposure

ROOT = Path(__file__).resolve().parent.parent
SPEC = ROOT / "scene_specs" / "3df-lighting-mini.yaml"
IMAGES = ROOT / "docs" / "images"
PAPER, INK, GAP, HEADER = (255, 255, 255), (32, 32, 32), 4, 30


@dataclass(frozen=True, kw_only=True)
class Picture:
    """One picture. columns: layers side by side, or none to lay single layers out in rows of `across`."""

    name: str
    overrides: tuple[str, ...]
    examples: tuple[int, ...]
    columns: tuple[str, ...]
    across: int = 1
    titled: bool = False


TUPLES = Picture(
    name="tuples", titled=True, examples=(28, 0, 18, 5, 17),
    columns=("i_s", "d", "r", "i_t", "s_prime", "mask"),
    overrides=(
        "seed=3", "image={width: 224, height: 224}",
        "render.spp={first_hit: 256, source: 400, target: 1024, rough: 1024}",
        "layers={i_s: frame, d: object, r: object, i_t: frame, s_prime: object, mask: object}",
        "camera.fov=40", "camera.coverage=[0.25, 0.45]", "camera.visibility=0.9",
        "camera.elevation={uniform: [12, 28]}",
        "target.kinds=[area, sphere]", "target.lights=1", "splits.train.views=1"))

ROOMS = Picture(
    name="rooms", examples=(34, 27), columns=("i_t",), across=2,
    overrides=(
        "seed=5", "image={width: 420, height: 280}", "render.spp=576", "layers={i_t: frame}",
        "camera.fov={uniform: [60, 74]}", "camera.coverage=[0.05, 0.16]", "camera.visibility=0.7",
        "camera.elevation={uniform: [14, 30]}", "target.kinds=[area]", "target.lights=2", "target.dome=0.8",
        "target.size=0.5", "target.elevation={uniform: [55, 80]}", "target.strength=2", "target.brightness=[0.2, 20]",
        "target.temperature={uniform: [3800, 6000]}", "splits.train.views=2", "splits.train.pairs=18",
        "splits.train.objects={count: 6, from: [objects/sofa.yaml, objects/armchair.yaml, objects/bed.yaml, "
        "objects/desk.yaml, objects/coffee_table.yaml, objects/dining_table.yaml]}"))


def render(picture: Picture) -> Iterator[Mapping[str, np.ndarray]]:
    """The layers of every example of a picture, in order."""
    loaded = load_dataset(SPEC, picture.overrides)
    planner = Planner(loaded)
    for index in picture.examples:
        yield next(render_view([planner.example(planner.examples[index])], loaded.path.parent)).layers


def row(layers: Mapping[str, np.ndarray], columns: tuple[str, ...]) -> list[Image.Image]:
    """Cells of one example; its radiometric layers share one exposure."""
    factor = exposure(layers[name] for name in columns if LAYERS[name].radiometric)
    return [Image.fromarray(cell_pixels(name, layers[name], factor)) for name in columns]


def compose(picture: Picture) -> Image.Image:
    """All cells on one sheet, with the names of the columns on top where it is titled."""
    cells = [cell for layers in render(picture) for cell in row(layers, picture.columns)]
    across = picture.across * len(picture.columns)
    width, height = cells[0].size
    top = HEADER if picture.titled else 0
    size = (across * (width + GAP) - GAP, top + -(-len(cells) // across) * (height + GAP) - GAP)
    sheet = Image.new("RGB", size, PAPER)
    for number, cell in enumerate(cells):
        line, column = divmod(number, across)
        sheet.paste(cell, (column * (width + GAP), top + line * (height + GAP)))
    if picture.titled:
        for column, name in enumerate(picture.columns):
            place = (column * (width + GAP) + width / 2, top / 2)
            ImageDraw.Draw(sheet).text(place, name, fill=INK, font=ImageFont.load_default(18), anchor="mm")
    return sheet


def main(folder: Path) -> None:
    """Write every picture into `folder`."""
    activate("auto", cores())
    folder.mkdir(parents=True, exist_ok=True)
    for picture in (TUPLES, ROOMS):
        path = folder / f"{picture.name}.webp"
        compose(picture).save(path, lossless=True, quality=100, method=6)
        print(f"{path}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES)
