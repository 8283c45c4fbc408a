"""Methods on views that follow each other: how each view is, and how much neighbours differ on the same surface.

*Flicker* is the mean absolute difference of neighbouring pictures, in display values at one exposure for the whole
sequence, over the pixels of the earlier one whose surface the later one sees, too: the later picture is warped into the
earlier view by depth. Light moves over a surface as the view does, highlights above all, so that the truth flickers,
too, and is a row of its own. The *flicker of the error* is the same of prediction less truth: 0 for a prediction that
changes just as the truth does.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import exp, log
from pathlib import Path
from statistics import fmean

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from dataset_builder.errors import Problem, UserError
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.geometry.reprojection import View, correspond
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.sequence_plan import SequencePlan
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset, opened
from dataset_builder.lightnet.data.ranges import inside_only, tone_map
from dataset_builder.lightnet.measures.truth_noise import noise_of
from dataset_builder.lightnet.results.evaluate import Contender, ScoreRow, row
from dataset_builder.remote.address import title_of
from dataset_builder.shards.reader import load_manifest, open_dataset

TRUTH, DEPTH = "truth", "depth"
PATH = "give a split of the spec a camera with a `path`, and build it"


@dataclass(frozen=True, kw_only=True)
class ViewSequence:
    """Examples of one path under one light, at one noise level."""

    name: str
    indices: tuple[int, ...]
    """Positions in the dataset, in order."""
    frames: tuple[int, ...]
    """Their places in the sequence."""
    planned: int
    """Views that it was to have."""

    @property
    def neighbours(self) -> int:
        """How often one view follows the other without a gap."""
        return sum(after - before == 1 for before, after in pairwise(self.frames))


@dataclass(frozen=True, kw_only=True)
class FlickerRow:
    """Two neighbouring views by one method, or `truth`."""

    method: str
    sequence: str
    frame: int
    """Place of the earlier one."""
    key: str
    """Of the earlier one."""
    flicker: float
    error_flicker: float
    """Of prediction less truth."""
    overlap: float
    """Share of the earlier one's object whose surface the later one sees, too."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Shown:
    """One view, by all methods and the truth."""

    frame: int
    key: str
    view: View
    pictures: dict[str, np.ndarray]
    """(H, W, 3) display values."""


def sequence_split(folder: Path | str) -> str:
    """The first split of a finished dataset that has sequences. Raises UserError where none has."""
    dataset = open_dataset(folder, layers=())
    for name, keys in dataset.splits.items():
        if keys and dataset.label(keys[0]).plan.sequence.name:
            return name
    raise UserError([Problem(where=title_of(folder), path="splits", hint=PATH,
                             rule=f"expected a split with sequences, got {', '.join(dataset.splits)} without")])


def sequences_of(dataset: LightingDataset) -> list[ViewSequence]:
    """The sequences of a split, in the order of their first examples; each light and noise level is one of its own.

    Raises UserError where there is none, or where no depth is there to warp by.
    """
    where = title_of(dataset.folder)
    if DEPTH not in [layer.name for layer in load_manifest(dataset.folder).layers]:
        raise UserError([Problem(where=where, path="layers", hint="build it with `depth: object`",
                                 rule="expected the layer depth, which neighbouring views are warped by, got none")])
    found: dict[str, list[tuple[SequencePlan, int]]] = {}
    for index in range(len(dataset)):
        plan = dataset.label(index).plan
        if plan.sequence.name:
            name = plan.sequence.example_name(plan.light, plan.rough.level)
            found.setdefault(name, []).append((plan.sequence, index))
    if not found:
        raise UserError([Problem(where=where, path=f"split {dataset.split}", hint=PATH,
                                 rule="expected sequences, got views that do not follow each other")])
    return [_sequence(name, sorted(views, key=lambda view: view[0].frame)) for name, views in found.items()]


def _sequence(name: str, views: Sequence[tuple[SequencePlan, int]]) -> ViewSequence:
    return ViewSequence(name=name, indices=tuple(index for _, index in views),
                        frames=tuple(place.frame for place, _ in views), planned=views[0][0].frames)


def evaluate_sequences(contenders: Sequence[Contender], dataset: LightingDataset,
                       sequences: Sequence[ViewSequence]) -> Iterator[ScoreRow | FlickerRow]:
    """A row for each view and contender, and one for each two neighbours and contender, the truth included.

    Neighbours of a view that is missing, and those that see no surface both, have none. Trained methods run once
    beforehand, as `evaluate` has it.
    """
    depths = opened(dataset.folder, (DEPTH,), dataset.spec, label=False)
    for sequence in sequences:
        exposure, before = _exposure(dataset, sequence), None
        for frame, index in zip(sequence.frames, sequence.indices, strict=True):
            batch, plan = dataset[index], dataset.label(index).plan
            noise = noise_of(batch)
            gain, inside = exposure / float(batch.exposure[0]), batch.inputs.inside
            pictures = {TRUTH: _display(batch.truth.i_t, inside, gain)}
            for one in contenders:
                moved = batch.to(one.device)
                if one.trained and sequence is sequences[0] and index == sequence.indices[0]:
                    one.find(moved)
                scored, prediction = row(one, moved, plan, noise)
                yield scored
                pictures[one.name] = _display(prediction.i_t, moved.inputs.inside, gain)
            height, width = dataset.size
            view = View(camera=_from_target(plan, width, height), inside=inside[0, 0].numpy() > 0,
                        depth=depths[batch.keys[0]][DEPTH][..., 0])
            now = _Shown(frame=frame, key=batch.keys[0], view=view, pictures=pictures)
            if before is not None and frame == before.frame + 1:
                yield from _flicker(sequence.name, before, now)
            before = now


def _from_target(plan: ExamplePlan, width: int, height: int) -> Pinhole:
    """The camera in the frame of its target, which may turn from view to view."""
    camera, target = Pinhole.of(plan.camera, width, height), plan.target
    turn = Rotation.from_euler("z", -target.yaw, degrees=True)
    return replace(camera, position=turn.apply(camera.position - target.position),
                   target=turn.apply(camera.target - target.position), up=turn.apply(camera.up))


def _flicker(sequence: str, before: _Shown, now: _Shown) -> Iterator[FlickerRow]:
    """Rows of all methods."""
    both = correspond(before.view, now.view)
    if not both.pixels.any():
        return
    changes = {name: both.here(picture) - both.there(now.pictures[name]) for name, picture in before.pictures.items()}
    overlap = float(both.pixels.sum() / before.view.inside.sum())
    for name, change in changes.items():
        yield FlickerRow(method=name, sequence=sequence, frame=before.frame, key=before.key, overlap=overlap,
                         flicker=float(np.abs(change).mean()),
                         error_flicker=float(np.abs(change - changes[TRUTH]).mean()))


def _exposure(dataset: LightingDataset, sequence: ViewSequence) -> float:
    """One exposure for a sequence: the geometric mean of those of its examples."""
    return exp(fmean(log(dataset.part(index).exposure) for index in sequence.indices))


def _display(i_t: torch.Tensor, inside: torch.Tensor, gain: float) -> np.ndarray:
    """(H, W, 3) float64 display values in [0, 1] of (1, 3, H, W) exposed light, exposed `gain` times as much."""
    shown = tone_map(inside_only(i_t, inside) * gain).clamp(0, 1)
    return shown[0].permute(1, 2, 0).detach().cpu().double().numpy()
