"""All photographs of a capture as pixels in files: one in memory at a time, and none made twice."""

import json
import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dataset_builder.assets.pose_readers.capture import Capture, CaptureShot
from dataset_builder.digest import digest
from dataset_builder.errors import Problem, UserError
from dataset_builder.files import output_errors, require_space, write_atomic
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.importing.captures.photographs import (
    Ball,
    frame_size,
    median_luminance,
    photograph,
    sharpness,
)

ROLL, DONE, KEY = "pixels.f16", "done.jsonl", "key"
UNREAD = {"focal": (1.0, 1.0), "centre": (0.0, 0.0), "share": 0.0, "sharpness": 0.0, "median": 0.0, "seal": ""}
"""Of an image that cannot be read."""
TOGETHER = 64
"""Photographs that are made before they are noted as done."""
EVERY = 8
"""One image in so many is held out, from twice as many on."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Roll:
    """Photographs as they were taken, in the capture's own frame."""

    images: PosedImages
    """Their pixels are mapped from a file."""
    share: np.ndarray
    """(N,) of the frame that the mask takes."""
    sharpness: np.ndarray
    """(N,), see `photographs.sharpness`."""
    median: np.ndarray
    """(N,) median luminance of what is opaque."""
    seals: tuple[str, ...]
    """SHA-256 of the files of each."""
    faults: tuple[tuple[Problem, ...], ...]
    """Why each cannot be used; its pixels are 0 then."""


def developed(capture: Capture, size: int, ball: Ball | None, work: Path,
              told: Callable[[int, int], None] = lambda done, of: None) -> Roll:
    """Every photograph at a longest side of `size` pixels, as float16 in a file in the folder `work`.

    What an interrupted call left there is taken up, if it was of the same files, cameras and settings. told: how many
    are done, and of how many. Raises OutputError where nothing can be written.
    """
    width, height = frame_size([shot.lens.size for shot in capture.shots], size)
    shape = (len(capture.shots), height, width, 4)
    key = digest({"shots": [_identity(shot) for shot in capture.shots], "size": [width, height],
                  "ball": asdict(ball) if ball else None})
    with output_errors(work):
        if not (work / KEY).is_file() or (work / KEY).read_text() != key:
            shutil.rmtree(work, ignore_errors=True)
            work.mkdir(parents=True)
            require_space(work, 2 * int(np.prod(shape)) * 2)
            (work / ROLL).touch()
            os.truncate(work / ROLL, int(np.prod(shape)) * 2)
            write_atomic(work / KEY, key.encode())
        rows = _finished(work / DONE)
        with (work / ROLL).open("r+b") as roll, (work / DONE).open("a") as log:
            fresh = list[dict[str, Any]]()
            for index, shot in enumerate(capture.shots):
                if index not in rows:
                    try:
                        taken = photograph(shot, (width, height), ball)
                    except UserError as error:
                        fresh.append({**UNREAD, "index": index, "faults": [asdict(each) for each in error.problems]})
                    else:
                        roll.seek(index * taken.pixels.size * 2)
                        roll.write(taken.pixels.astype(np.float16).tobytes())
                        fresh.append({"index": index, "focal": taken.focal, "centre": taken.centre,
                                      "share": taken.share, "sharpness": sharpness(taken.pixels),
                                      "median": median_luminance(taken.pixels), "seal": taken.sha256, "faults": []})
                if len(fresh) == TOGETHER or index + 1 == len(capture.shots):
                    # Pixels are on the disk before anything says so
                    roll.flush()
                    os.fsync(roll.fileno())
                    log.writelines(json.dumps(row) + "\n" for row in fresh)
                    log.flush()
                    rows |= {row["index"]: row for row in fresh}
                    fresh.clear()
                told(index + 1, len(capture.shots))
        pixels = np.memmap(work / ROLL, dtype=np.float16, mode="r", shape=shape)
    ordered = [rows[index] for index in range(len(capture.shots))]

    def column(name: str) -> np.ndarray:
        return np.array([row[name] for row in ordered], dtype=np.float64)

    images = PosedImages(pixels=pixels, poses=np.stack([shot.pose for shot in capture.shots]), focal=column("focal"),
                         centre=column("centre"), names=tuple(shot.name for shot in capture.shots))
    return Roll(images=images, share=column("share"), sharpness=column("sharpness"), median=column("median"),
                seals=tuple(str(row["seal"]) for row in ordered),
                faults=tuple(tuple(Problem(**each) for each in row["faults"]) for row in ordered))


def _identity(shot: CaptureShot) -> dict[str, object]:
    """What tells a shot from what it was before, without reading its files."""
    stats = [(str(path), found.st_size, found.st_mtime_ns) for path in (shot.image, shot.mask)
             if path is not None and (found := path.stat())]
    return {"lens": asdict(shot.lens), "pose": shot.pose.tolist(), "files": stats}


def _finished(path: Path) -> dict[int, dict[str, Any]]:
    """Rows of the images that are done; a line that was cut short is none."""
    rows = {}
    for line in path.read_text().splitlines() if path.is_file() else ():
        try:
            row = json.loads(line)
        except ValueError:
            continue
        rows[int(row["index"])] = row
    return rows


def parted(roll: Roll, kept: Sequence[int], gains: np.ndarray, work: Path) -> tuple[PosedImages, PosedImages]:
    """Images to fit to and images to measure on: the kept ones, divided by their gains (N,), in files of their own, so
    that neither has to be gathered in memory."""
    held = [index for place, index in enumerate(kept) if len(kept) >= 2 * EVERY and place % EVERY == EVERY // 2]
    rest = [index for index in kept if index not in set(held)]
    return _copied(roll, rest, gains, work / "fitted.f16"), _copied(roll, held, gains, work / "held_out.f16")


def _copied(roll: Roll, chosen: list[int], gains: np.ndarray, path: Path) -> PosedImages:
    images = roll.images
    shape = (len(chosen), *images.pixels.shape[1:])
    if not chosen:
        pixels = np.zeros(shape, np.float16)
    else:
        with output_errors(path):
            pixels = np.memmap(path, dtype=np.float16, mode="w+", shape=shape)
            for place, index in enumerate(chosen):
                pixels[place] = images.pixels[index]
                if gains[index] != 1:
                    pixels[place, ..., :3] = images.pixels[index, ..., :3].astype(np.float32) / gains[index]
            pixels.flush()
    return PosedImages(pixels=pixels, poses=images.poses[chosen], focal=images.focal[chosen],
                       centre=images.centre[chosen], names=tuple(images.names[index] for index in chosen))
