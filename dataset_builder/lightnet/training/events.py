"""What a training reports while it runs, and TensorBoard's event files of it, beside the checkpoints."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING


@dataclass(frozen=True, kw_only=True)
class Started:
    """What is about to be trained."""

    parameters: dict[str, int]
    """Trainable numbers, by phase."""
    first: int
    """The step that comes next, 0 unless a training goes on."""
    steps: int
    train: int
    held_out: int
    device: str
    precision: str
    """Of the network."""
    off: tuple[str, ...]
    """Losses that are off, and why."""
    notes: tuple[str, ...] = ()
    """What to know about the examples."""


@dataclass(frozen=True, kw_only=True)
class Stepped:
    """One batch."""

    step: int
    """Counted from 1."""
    loss: dict[str, float]
    """Weighted sums by phase."""
    terms: dict[str, float]
    """Unweighted."""
    norm: float
    """Of the gradient before clipping, the largest of all phases."""
    rate: float
    skipped: str
    """Why nothing was learnt from it, empty where something was."""
    images: int
    seconds: float
    """Of the step."""
    waited: float
    """Of `seconds`, those for data."""


@dataclass(frozen=True, kw_only=True)
class Checked:
    """Mean metrics on held-out examples after `step` batches; none where nothing is held out."""

    step: int
    metrics: dict[str, float]
    corrected: dict[str, float] = field(default_factory=dict)
    """Estimate of what `metrics` would be against truth without noise; none where nobody knows the noise."""
    ceiling: dict[str, float] = field(default_factory=dict)
    """Of a perfect prediction, against the truth as it is; none as `corrected`."""
    examples: int
    best: bool
    """Whether its PSNR is the highest so far."""
    stale: int
    """Checks since the best."""

    @property
    def figures(self) -> dict[str, float]:
        """All of them, by the names that columns of tables have: `psnr`, `psnr_corrected`, `psnr_ceiling`."""
        return {name + end: value for end, found in (("", self.metrics), ("_corrected", self.corrected),
                                                     ("_ceiling", self.ceiling)) for name, value in found.items()}


@dataclass(frozen=True, kw_only=True)
class Finished:
    """The end."""

    step: int
    reason: str
    """`steps`, all were done; `patience`, no check was better for long enough; `already`, an earlier run had come to
    the end."""
    best: tuple[int, float]
    """Step and PSNR of the best check; PSNR is -inf where there was none."""
    bad_steps: int
    last_file: Path
    best_file: Path


Event = Started | Stepped | Checked | Finished


if TYPE_CHECKING:
    from torch.utils.tensorboard import SummaryWriter


class Board:
    """Writes below `folder`; what an interrupted run wrote from step `first` on is hidden by the new run's."""

    def __init__(self, folder: Path, first: int):
        self._folder, self._first = folder, first
        self._writer: SummaryWriter | None = None

    def step(self, stepped: Stepped) -> None:
        """Losses, gradient norm, rate, images per second and the share of time spent waiting for data."""
        values = {**{f"loss/{name}": value for name, value in stepped.loss.items()},
                  **{f"term/{name}": value for name, value in stepped.terms.items()},
                  "optimiser/rate": stepped.rate, "optimiser/norm": stepped.norm,
                  "speed/images_per_second": stepped.images / stepped.seconds,
                  "speed/waited": stepped.waited / stepped.seconds}
        self._write(values, stepped.step)

    def check(self, checked: Checked) -> None:
        """Figures of held-out examples."""
        self._write({f"held_out/{name}": value for name, value in checked.figures.items()}, checked.step)

    def close(self) -> None:
        """Flush what is left."""
        if self._writer is not None:
            self._writer.close()

    def _write(self, values: dict[str, float], step: int) -> None:
        for name, value in values.items():
            self._open().add_scalar(name, value, step)

    def _open(self) -> "SummaryWriter":
        if self._writer is None:
            # Importing it takes longer than many a short training
            from torch.utils.tensorboard import SummaryWriter

            self._writer = SummaryWriter(str(self._folder), purge_step=self._first + 1 if self._first else None)
        return self._writer
