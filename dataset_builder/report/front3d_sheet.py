"""Scenes of a proposal seen from above: floors, walls with doors and windows, furniture by what it is."""

from collections.abc import Mapping, Sequence
from math import ceil
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from dataset_builder.assets.file_model import counted
from dataset_builder.engine.local import run
from dataset_builder.files import write_atomic
from dataset_builder.importing.front3d_split import SplitProposal
from dataset_builder.importing.future_models import GROUPS, FutureModel, category_in, target_group
from dataset_builder.importing.read_scene import FloorPlan, FurnitureBox, RoomOutline, floor_plan
from dataset_builder.importing.scene_index import SceneIndex
from dataset_builder.report.example_sheet import INK, MARGIN, PALE, PAPER, png_of

CELL, TEXT, GAP, COLUMNS = 300, 54, 14, 7
"""Pixels of a plan's side, of the text below it, between plans; plans beside each other."""
FINER = 3
"""Times finer that plans are drawn before they are averaged down."""
COLOURS = {"chair": (230, 159, 0), "sofa": (0, 158, 115), "table": (170, 112, 60), "cabinet": (86, 130, 200),
           "bed": (204, 110, 160), "stool": (240, 210, 70), "lamp": (213, 70, 40), "": (178, 178, 178)}
"""Of furniture by group; "" is everything else."""
FLOOR, IDLE, WALL, WINDOW, DOOR, TARGET = (238, 232, 220), (214, 214, 214), (40, 40, 40), (120, 190, 235), \
    (150, 90, 40), (0, 0, 0)


def write_front3d_sheet(proposal: SplitProposal, models: Mapping[str, FutureModel], folder: Path, target: Path, *,
                        workers: int) -> None:
    """Draw every scene of a proposal, from files in `folder`, into a PNG file. Raises OutputError."""
    scenes = [scene for split in proposal.splits for scene in split.scenes]
    units = [folder / scene.file for scene in scenes]
    plans = {plan.file: plan for plan in run(floor_plan, units, workers=min(workers, len(units)))
             if isinstance(plan, FloorPlan)}
    columns = min(COLUMNS, max(len(split.scenes) for split in proposal.splits))
    heights = [ceil(len(split.scenes) / columns) * (CELL + TEXT + GAP) + 40 for split in proposal.splits]
    width = max(2 * MARGIN + columns * (CELL + GAP) - GAP, 900)
    page = Image.new("RGB", (width, 2 * MARGIN + 56 + sum(heights)), PAPER)
    _legend(ImageDraw.Draw(page))
    top = MARGIN + 56
    for split, height in zip(proposal.splits, heights, strict=True):
        chosen = {choice.jid for choice in split.targets}
        _text(page, (MARGIN, top), f"{split.name}: {counted(len(split.scenes), 'scene')}, "
              f"{counted(len(split.targets), 'target')}", 18)
        for number, scene in enumerate(split.scenes):
            left = MARGIN + number % columns * (CELL + GAP)
            page.paste(_cell(scene, plans.get(scene.file), models, chosen),
                       (left, top + 32 + number // columns * (CELL + TEXT + GAP)))
        top += height
    write_atomic(target, png_of(np.asarray(page)))


def _legend(draw: ImageDraw.ImageDraw) -> None:
    left = MARGIN
    for name, colour in [*((group, COLOURS[group]) for group in GROUPS), ("other", COLOURS[""])]:
        draw.rectangle((left, MARGIN + 1, left + 14, MARGIN + 15), fill=colour, outline=PALE)
        draw.text((left + 20, MARGIN), name, fill=INK, font=ImageFont.load_default(13))
        left += 34 + round(draw.textlength(name, font=ImageFont.load_default(13)))
    draw.rectangle((left, MARGIN + 1, left + 14, MARGIN + 15), outline=COLOURS["chair"])
    draw.text((left + 20, MARGIN), "no model", fill=INK, font=ImageFont.load_default(13))
    draw.rectangle((left + 88, MARGIN + 1, left + 102, MARGIN + 15), outline=TARGET, fill=COLOURS["chair"], width=3)
    draw.text((left + 108, MARGIN), "target of the split", fill=INK, font=ImageFont.load_default(13))
    left = MARGIN
    for name, colour in (("wall", WALL), ("window", WINDOW), ("door", DOOR), ("floor", FLOOR),
                         ("room that cannot be used", IDLE)):
        draw.rectangle((left, MARGIN + 29, left + 14, MARGIN + 33), fill=colour, outline=PALE)
        draw.text((left + 20, MARGIN + 24), name, fill=INK, font=ImageFont.load_default(13))
        left += 34 + round(draw.textlength(name, font=ImageFont.load_default(13)))
    draw.text((left, MARGIN + 24), "the bar is 2 m; furniture by its declared size, a short line at its front",
              fill=PALE, font=ImageFont.load_default(13))


def _cell(scene: SceneIndex, plan: FloorPlan | None, models: Mapping[str, FutureModel],
          targets: set[str]) -> Image.Image:
    """A plan with its text."""
    cell = Image.new("RGB", (CELL, CELL + TEXT), PAPER)
    if plan is not None:
        cell.paste(_drawing(scene, plan, models, targets), (0, 0))
    standing = sum(len(room.pieces) for room in scene.rooms)
    area = sum(room.area for room in scene.rooms)
    usable, faults = len(scene.usable(models)), sum(scene.faults.values())
    lines = (Path(scene.file).stem[:42], f"{usable} of {len(scene.rooms)} rooms can be used, {area:.0f} m^2",
             f"{sum(1 for _ in scene.jids(models))} of {standing} pieces have models, {counted(faults, 'fault')}")
    for number, line in enumerate(lines):
        _text(cell, (2, CELL + 2 + 17 * number), line, 12, PALE if number else INK)
    return cell


class _Canvas:
    """Metres to pixels."""

    def __init__(self, points: np.ndarray) -> None:
        low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(2), np.ones(2))
        self.side = CELL * FINER
        self.scale = 0.94 * self.side / max(float((high - low).max()), 1.0)
        self.centre = (low + high) / 2
        self.image = Image.new("RGB", (self.side, self.side), (255, 255, 255))
        self.draw = ImageDraw.Draw(self.image)

    def at(self, points: np.ndarray) -> list[tuple[float, float]]:
        """Pixels of (N, 2) metres."""
        x, y = ((points - self.centre) * self.scale * (1, -1) + self.side / 2).T
        return list(zip(x.tolist(), y.tolist(), strict=True))


def _drawing(scene: SceneIndex, plan: FloorPlan, models: Mapping[str, FutureModel],
             targets: set[str]) -> Image.Image:
    every = [room.floor.reshape(-1, 2) for room in plan.rooms] + [plan.low_walls.reshape(-1, 2)]
    canvas = _Canvas(np.concatenate(every))
    usable = {room.name for room in scene.usable(models)}
    for room in plan.rooms:
        for triangle in room.floor:
            colour = FLOOR if room.name in usable else IDLE
            canvas.draw.polygon(canvas.at(triangle), fill=colour, outline=colour)
    boxes = sorted((box for room in plan.rooms for box in room.furniture), key=lambda box: box.top)
    for box in boxes:
        _draw_box(canvas, box, models, targets)
    for segments, colour in ((plan.low_walls, WINDOW), (plan.walls, WALL), (plan.doors, DOOR)):
        for segment in segments:
            canvas.draw.line(canvas.at(segment), fill=colour, width=2 * FINER)
    side = canvas.side
    canvas.draw.line([(6 * FINER, side - 6 * FINER), (6 * FINER + 2 * canvas.scale, side - 6 * FINER)], fill=INK,
                     width=2 * FINER)
    small = canvas.image.resize((CELL, CELL), Image.Resampling.BOX)
    _name_rooms(small, canvas, plan.rooms)
    return small


def _draw_box(canvas: _Canvas, box: FurnitureBox, models: Mapping[str, FutureModel], targets: set[str]) -> None:
    """A box; a line joins the middle with the front."""
    group, _ = target_group(category_in(models, box.jid, box.category))
    there = box.valid and box.jid in models
    corners = canvas.at(box.corners)
    edge = TARGET if box.jid in targets else PALE if there else COLOURS[group]
    canvas.draw.polygon(corners, fill=COLOURS[group] if there else None, outline=edge,
                        width=FINER * (3 if box.jid in targets else 1))
    middle, front = box.corners.mean(axis=0), box.corners[:2].mean(axis=0)
    canvas.draw.line(canvas.at(np.stack([(middle + front) / 2, front])), fill=edge, width=FINER)


def _name_rooms(image: Image.Image, canvas: _Canvas, rooms: Sequence[RoomOutline]) -> None:
    """The kinds of rooms along the lower edges of their floors, or the upper ones, where there is space."""
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(9)
    for room in (room for room in rooms if len(room.floor)):
        for anchor, turn, shift in (("ls", 1, -3), ("lt", -1, 4)):
            levels = turn * room.floor[:, :, 1]
            edge = room.floor[levels.min(axis=1) < levels.min() + 0.1].reshape(-1, 2)
            place = np.array([[edge[:, 0].min(), turn * levels.min()]])
            if draw.textlength(room.kind, font=font) < np.ptp(edge[:, 0]) * canvas.scale / FINER - 6:
                x, y = canvas.at(place)[0]
                draw.text((x / FINER + 4, y / FINER + shift), room.kind, fill=INK, font=font, anchor=anchor,
                          stroke_width=1, stroke_fill=FLOOR)
                break


def _text(image: Image.Image, place: tuple[int, int], text: str, size: int,
          colour: tuple[int, int, int] = INK) -> None:
    ImageDraw.Draw(image).text(place, text, fill=colour, font=ImageFont.load_default(size))
