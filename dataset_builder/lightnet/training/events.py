"""What a training reports while it runs."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, kw_only=True)
class Started:
    """parameters: trainable numbers, by phase; first: the step that comes next, 0 unless a training goes on; off:
    losses that are off, and why; notes: what to know about the examples; precision: of the network."""

    parameters: dict[str, int]
    first: int
    steps: int
    train: int
    held_out: int
    device: str
    precision: str
    off: tuple[str, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Stepped:
    """One batch. step: counted from 1; loss: weighted sums by phase; terms: unweighted; norm: of the gradient before
    clipping, the largest of all phases; skipped: why nothing was learnt from it, empty where something was.

    seconds: of the step; waited: of those, for data.
    """

    step: int
    loss: dict[str, float]
    terms: dict[str, float]
    norm: float
    rate: float
    skipped: str
    images: int
    seconds: float
    waited: float


@dataclass(frozen=True, kw_only=True)
class Checked:
    """Mean metrics on held-out examples after `step` batches. best: the highest PSNR so far; stale: checks since."""

    step: int
    metrics: dict[str, float]
    examples: int
    best: bool
    stale: int


@dataclass(frozen=True, kw_only=True)
class Finished:
    """The end. reason: `steps`, all were done; `patience`, no check was better for long enough; `already`, an earlier
    run had come to the end. best: (step, PSNR) of the best check."""

    step: int
    reason: str
    best: tuple[int, float]
    bad_steps: int
    last_file: Path
    best_file: Path


Event = Started | Stepped | Checked | Finished
