"""TensorBoard: losses, rates and checks as event files beside the checkpoints."""

from pathlib import Path
from typing import TYPE_CHECKING

from dataset_builder.lightnet.training.events import Checked, Stepped

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
        """Metrics on held-out examples."""
        self._write({f"held_out/{name}": value for name, value in checked.metrics.items()}, checked.step)

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
