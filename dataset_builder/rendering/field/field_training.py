"""The steps of a fit, stage by stage, from wherever it was interrupted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from drjit.opt import Adam

from dataset_builder.assets.field_file import CHANNELS
from dataset_builder.errors import UserError
from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.field.field_grid import FieldGrid
from dataset_builder.rendering.field.field_model import FieldModel
from dataset_builder.rendering.field.field_pixels import FitPixels
from dataset_builder.rendering.field.field_stages import FitStage, first_begin, next_begin
from dataset_builder.rendering.field.field_state import FitState
from dataset_builder.rendering.field.field_step import Drawn, Losses, take_step
from dataset_builder.seeding import derive_seed

EVERY = 50
"""Steps after which progress is told and the state is kept."""
LAST = 20
"""Steps whose losses are kept for the record."""
EPSILON = 1e-6
"""Of Adam: cells whose gradients are far smaller, such as those behind a surface, hardly move. Else they would wander
as fast as all others."""
FALL = 0.1
"""Of the rate over a stage."""


@dataclass(frozen=True, kw_only=True)
class FitProgress:
    """How far a fit is."""

    step: int
    """Steps taken."""
    steps: int
    """Of the whole fit."""
    loss: float
    psnr: float
    """dB on the pixels of the last step that are inside of masks, sRGB-encoded."""


Told = Callable[[FitProgress], None]


def trained(stages: Sequence[FitStage], state: FitState, pixels: FitPixels, hull: np.ndarray, *, seed: int, where: str,
            told: Told) -> np.ndarray:
    """(R, R, R, 4) values after all steps. Raises UserError where the loss is not finite, or nothing is left to fit."""
    total = sum(stage.steps for stage in stages)
    for number in range(state.stage, len(stages)):
        stage, done = stages[number], sum(each.steps for each in stages[:number])
        begin = first_begin(hull) if state.before is None else next_begin(stage, state.before, hull)
        grid, spanned = FieldGrid.of(begin.active), pixels.spanned(begin.occupied, begin.optical)
        if not spanned.count:
            raise UserError(f"{where}: expected a field that holds something, got an empty one after {done} of {total} "
                            "steps (check masks and cameras)")
        optimiser = _optimiser(begin.values[begin.active], state)
        while state.step < stage.steps:
            losses = _one_step(stage, state, grid, optimiser, spanned, derive_seed(seed, "stage", number))
            loss = float(losses.total[0])
            if not np.isfinite(loss):
                raise UserError(f"{where}: expected a fit that settles, got a loss of {loss} after {done + state.step} "
                                f"of {total} steps (check the images for extreme values)")
            state.losses = [*state.losses, loss][-LAST:]
            if state.step % EVERY and state.step < stage.steps:
                continue
            if state.step < stage.steps:
                state.moments = _moments(optimiser)
                state.keep()
            else:
                state.before = grid.dense(optimiser["table"].numpy().reshape(-1, CHANNELS))
                state.moments, state.stage, state.step = None, number + 1, 0
                state.keep()
            told(_progress(losses, done + (state.step or stage.steps), total))
            if not state.step:
                break
    assert state.before is not None
    return state.before


def _one_step(stage: FitStage, state: FitState, grid: FieldGrid, optimiser: Adam, pixels: FitPixels,
              seed: int) -> Losses:
    """The next step of a stage."""
    share, (low, high) = state.step / stage.steps, stage.sharpness
    optimiser.set_learning_rate(stage.rate * FALL**share)
    model = FieldModel(kind=stage.kind, cell=dr.opaque(mi.Float, 2 / stage.resolution),
                       sharpness=dr.opaque(mi.Float, low * (high / low) ** share))
    losses = take_step(grid, optimiser, model, pixels, stage.smooth, Drawn.of(seed, state.step))
    state.step += 1
    return losses


def _progress(losses: Losses, step: int, total: int) -> FitProgress:
    error = float(losses.error[0]) / max(float(losses.inside[0]), 1.0)
    psnr = -10 * float(np.log10(max(error, 1e-10)))
    return FitProgress(step=step, steps=total, loss=float(losses.total[0]), psnr=psnr)


def _optimiser(values: np.ndarray, state: FitState) -> Adam:
    """Adam with a table of rows, as the state has it or from the begin."""
    table = values if state.moments is None else state.moments[0]
    optimiser = Adam(lr=1.0, params={"table": owned(mi.Float, table)}, beta_2=0.99, epsilon=EPSILON)
    if state.moments is not None:
        value, promoted, rate, (count, first, second, most) = optimiser.state["table"]
        first, second = (owned(type(first), moment) for moment in state.moments[1:])
        optimiser.state["table"] = value, promoted, rate, (dr.opaque(type(count), state.step), first, second, most)
    return optimiser


def _moments(optimiser: Adam) -> tuple[np.ndarray, ...]:
    """Values of rows, and Adam's moments."""
    return tuple(array.numpy() for array in (optimiser["table"], *optimiser.state["table"][3][1:3]))
