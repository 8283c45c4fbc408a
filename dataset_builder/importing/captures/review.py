"""All checks of a capture in order, each with its figure and remedy; problems of one kind are reported together."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dataset_builder.assets.pose_readers.capture import Capture, listed
from dataset_builder.errors import Problem, UserError
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.importing.captures.darkroom import Roll, developed
from dataset_builder.importing.captures.photo_checks import HIGH, LOW, blurred, drifting, gains
from dataset_builder.importing.captures.photo_consistency import check_consistency, focus_of
from dataset_builder.importing.captures.photographs import LEAST, MOST, Ball, header_of, is_covered
from dataset_builder.importing.captures.pose_checks import FEWEST, shortened, shot_faults, too_few
from dataset_builder.importing.captures.silhouettes import (
    ENOUGH,
    Agreement,
    agreement,
    few_of,
)
from dataset_builder.importing.captures.silhouettes import LEAST as LEAST_IOU

DOUBTFUL = 0.8
"""Mismatch of photographs without masks from which their poses are doubted."""
SURROUNDINGS = ("a capture of surroundings, in which cameras look outwards, has no end and is not taken: a field here "
                "fills a ball, and space beyond it is not contracted")


@dataclass(frozen=True, kw_only=True, eq=False)
class Reviewed:
    """A capture that passed."""

    capture: Capture
    """Without shots that were left out."""
    roll: Roll
    kept: tuple[int, ...]
    """Indices of the images that are sharp."""
    gains: np.ndarray
    """(N,) that images are to be divided by."""
    ball: Ball
    """About the object, in the capture's frame."""
    masked: bool
    """Whether images have masks; without, what lies behind the object within the ball is part of it."""
    iou: float
    """Of the hull's silhouette and the masks; 0 without masks."""
    notes: tuple[str, ...]


def reviewed(capture: Capture, where: str, *, size: int, ball: Ball | None, skip: bool, work: Path,
             told: Callable[[int, int], None] = lambda done, of: None) -> Reviewed:
    """The capture with its pixels in the folder `work`, checked.

    ball: what to take where images have no masks; found where it is not given. skip: leave images out that cannot be
    used, instead of refusing. where: what messages call the capture. Raises UserError with every problem of cameras and
    files, or of pixels.
    """
    notes = list[str]()
    capture = _usable(capture, shot_faults(capture), where, skip, notes)
    masked = _masked(capture, where)
    if masked and ball is not None:
        notes.append("the ball or box that is given is not used: what the masks show is taken")
        ball = None
    if not masked:
        apart = check_consistency(capture, ball, where)
        ball = ball or focus_ball(capture, where)
        if apart > DOUBTFUL:
            notes.append("photographs hardly see the same colours at the same places (their difference is "
                         f"{apart:.2f} of chance, expected below {DOUBTFUL}): plain things, or wrong poses")
        notes.append(f"no masks: what is seen within {ball.radius:.3g} units of {_place(ball)} is taken with its "
                     "background, which was not removed")
    roll = developed(capture, size, ball, work, told)
    faults = [[*each] or _mask_faults(roll, index, capture, masked) for index, each in enumerate(roll.faults)]
    _usable(capture, faults, where, skip, notes)
    notes += _same(roll)
    good = [index for index, each in enumerate(faults) if not each]
    if not masked:
        assert ball is not None
        return Reviewed(capture=capture, roll=roll, kept=tuple(good), gains=np.ones(len(roll.share)), ball=ball,
                        masked=False, iou=0.0, notes=tuple(notes))
    few = few_of(roll.images, good)
    found = agreement(few, capture.layout)
    known = _agreed(found, where, notes)
    kept, evened = _compared(roll, good, known, few, notes)
    return Reviewed(capture=capture, roll=roll, kept=kept, gains=evened, ball=known, masked=True, iou=found.iou,
                    notes=tuple(notes))


def _usable(capture: Capture, faults: list[list[Problem]], where: str, skip: bool, notes: list[str]) -> Capture:
    """The capture without its faulty shots, where these may be left out. Raises UserError where not, or where too few
    are left."""
    bad = [index for index, each in enumerate(faults) if each]
    problems = shortened([problem for each in faults for problem in each])
    good = capture.only(index for index in range(len(faults)) if not faults[index])
    few = too_few(len(capture.shots) if not skip else len(good.shots), where)
    if few or (bad and not skip):
        mend = [Problem(where=where, path="", rule=f"{len(bad)} of {len(faults)} images cannot be used",
                        hint="mend them, or leave them out with --skip-bad")] if bad else []
        raise UserError([*problems, *mend, *few])
    if bad:
        notes.append(f"{len(bad)} images left out that cannot be used: "
                     f"{listed(capture.shots[index].name for index in bad)} ({problems[0].rule})")
    return good


def _masked(capture: Capture, where: str) -> bool:
    """Whether images have masks. Alpha is none where it is opaque all over the first image. Raises UserError where some
    have masks, and others not."""
    without = [shot for shot in capture.shots if shot.mask is None and not header_of(shot.image)[1]]
    alpha = [shot for shot in capture.shots if shot.mask is None]
    if not without and alpha == [*capture.shots] and not is_covered(alpha[0].image):
        return False
    if without and len(without) < len(capture.shots):
        raise UserError([Problem(where=where, path="", rule="expected masks (or alpha) for all images or for none, got "
                                 f"none for {len(without)}: {listed(shot.name for shot in without)}",
                                 hint="make the others, or take alpha and masks away")])
    return not without


def focus_ball(capture: Capture, where: str) -> Ball:
    """The ball about the point that all cameras look at. Raises UserError where they look away from it."""
    focus, radius, ahead = focus_of(np.stack([shot.pose for shot in capture.shots]))
    if ahead.mean() < 0.9:
        raise UserError([Problem(
            where=where, path="", rule="expected cameras that look at one object, got "
            f"{np.sum(~ahead)} of {len(ahead)} that look away from where their axes meet",
            hint="negate y and z of the camera axes if they are of the other convention; "
            f"{SURROUNDINGS}; a part of it can be taken with --ball or --box")])
    return Ball(centre=(float(focus[0]), float(focus[1]), float(focus[2])), radius=radius)


def _place(ball: Ball) -> str:
    return f"({', '.join(f'{value:.3g}' for value in ball.centre)})"


def _same(roll: Roll) -> list[str]:
    """What is to be told of photographs that are there more than once."""
    first = dict(zip(reversed(roll.seals), reversed(roll.images.names), strict=True))
    again = [f"{name} and {first[seal]}" for seal, name in zip(roll.seals, roll.images.names, strict=True)
             if seal and first[seal] != name]
    return [f"{len(again)} images are copies of others, byte for byte: {listed(again)}"] if again else []


def _mask_faults(roll: Roll, index: int, capture: Capture, masked: bool) -> list[Problem]:
    shot, share = capture.shots[index], roll.share[index]
    if not masked:
        return [] if share > 0 else [Problem(
            where=str(shot.image), path="", rule="expected an image that shows what is to be taken, got one that sees "
            "nothing of the ball or box", hint="give another --ball or --box, or leave the image out")]
    if LEAST <= share <= MOST:
        return []
    return [Problem(where=str(shot.mask or shot.image), path="", rule=f"expected a mask of {LEAST:.0%} to {MOST:.0%} "
                    f"of the frame, got {share:.1%}", hint="white is the object; mend the mask or leave the image out")]


def _agreed(found: Agreement, where: str, notes: list[str]) -> Ball:
    """The ball about the object. Raises UserError where cameras and masks do not belong together."""
    figure = f"the visual hull of the masks fills them to IoU {found.iou:.2f}"
    if found.remedy:
        raise UserError([Problem(where=where, path="", rule=f"expected cameras and masks that agree, got: {figure} "
                                 f"(expected {ENOUGH:g})", hint=f"{found.remedy}; with that it is {found.better:.2f}")])
    if found.ball is None or found.iou < LEAST_IOU:
        raise UserError([Problem(where=where, path="", rule=f"expected cameras and masks that agree, got: {figure} "
                                 f"(expected {ENOUGH:g}), and no convention of axes mends it",
                                 hint="look whether the object moved, whether masks are of other images, or whether "
                                 "poses went wrong")])
    if found.iou < ENOUGH:
        notes.append(f"{figure} (expected {ENOUGH:g}): thin parts, ragged masks, or poses that are a little off")
    return found.ball


def _compared(roll: Roll, good: list[int], ball: Ball, few: PosedImages,
              notes: list[str]) -> tuple[tuple[int, ...], np.ndarray]:
    """Those of the good images that are sharp, and the gains of all."""
    images, kept = roll.images, tuple(good)
    bad = {good[place] for place in blurred(roll.sharpness[good], images.poses[good], np.array(ball.centre))}
    if bad and len(good) - len(bad) >= FEWEST:
        kept = tuple(index for index in good if index not in bad)
        notes.append(f"{len(bad)} blurred images left out: {listed(images.names[index] for index in sorted(bad))}")
    found = gains(images, ball, few)
    used = found[list(kept)]
    if not drifting(used):
        return kept, np.ones(len(found))
    notes.append(f"exposures differ by factors of {used.min():.2f} to {used.max():.2f} where images see the same "
                 f"places (expected {LOW} to {HIGH}): all were evened, by one factor for each image")
    return kept, found


def without_blur(done: Reviewed) -> Capture:
    """The capture of the images that are kept."""
    return replace(done.capture, shots=tuple(done.capture.shots[index] for index in done.kept))
