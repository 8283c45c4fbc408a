"""Input of the study of noise: one spec at several levels, built as any dataset is, so that only S' repeats."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from dataset_builder.builder import Event, build
from dataset_builder.errors import Problem, UserError
from dataset_builder.layers import PAPER_LAYERS
from dataset_builder.lightnet.methods.vgg import check_file
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.loaded import LoadedSpec
from dataset_builder.studies.trainings import changed, settings_of


@dataclass(frozen=True, kw_only=True)
class NoiseStudy:
    """What to study."""

    spec: Path
    overrides: tuple[str, ...]
    levels: tuple[float, ...]
    """Sigmas, rising."""
    training: TrainingSpec
    """LighTNet on all levels, made by `studies.trainings.base_of`."""
    per_level_steps: int
    """Batches of each training that sees one level."""
    out: Path
    """The study's folder."""
    backend: str = "auto"
    workers: int | None = None
    """Processes that render, None for one per core."""
    vgg_weights: Path | None = None
    device: str = "auto"

    @property
    def dataset(self) -> Path:
        """Where the dataset is built."""
        return self.out / "dataset"

    @cached_property
    def settings(self) -> tuple[str, ...]:
        """All overrides of the spec."""
        return (*self.overrides, f"rough.sigma=[{', '.join(f'{level!r}' for level in self.levels)}]")

    @cached_property
    def loaded(self) -> LoadedSpec:
        """The spec at all levels. Raises SpecError."""
        return load_dataset(self.spec, self.settings)

    @property
    def per_level(self) -> TrainingSpec:
        """How LighTNet is trained on one level."""
        return changed(self.training, steps=self.per_level_steps)

    @property
    def sentence(self) -> str:
        """How it is done, to stand on everything that shows its figures."""
        return f"{settings_of(self.training, self.device)}; {self.per_level_steps} steps on each level alone"


def require(study: NoiseStudy) -> None:
    """Raise UserError where the study could not be done once the dataset is built, which may take hours."""
    problems, splits = [], [split.name for split in study.loaded.dataset.splits]
    if list(study.levels) != sorted(set(study.levels)) or len(study.levels) < 2 or study.levels[0] < 0:
        problems.append(_problem("--levels", "expected at least two numbers >= 0, each larger than the one before, got "
                                 f"{', '.join(f'{level:g}' for level in study.levels)}"))
    if lacking := [name for name in PAPER_LAYERS if name not in study.loaded.dataset.layers]:
        problems.append(_problem("layers", f"expected what training reads, got no {', '.join(lacking)}"))
    for name in (study.training.data.train, study.training.data.held_out):
        if name not in splits:
            problems.append(_problem("splits", f"expected a split {name}, got {', '.join(splits)}"))
    if problems:
        raise UserError(problems)
    if study.vgg_weights and study.training.objective.fr:
        check_file(study.vgg_weights)


def make(study: NoiseStudy) -> Iterator[Event]:
    """Build the dataset at all levels, or go on with it; news as of any build. Raises UserError as a build does."""
    require(study)
    yield from build(study.loaded, study.dataset, backend=study.backend, workers=study.workers)


def parse_levels(text: str) -> tuple[float, ...]:
    """Levels as the command line gives them. Raises UserError where one is no number.

    >>> parse_levels("0,0.002, 0.004")
    (0.0, 0.002, 0.004)
    """
    found: list[float] = []
    for part in text.split(","):
        try:
            found.append(float(part))
        except ValueError:
            raise UserError(f"--levels: expected numbers with commas between them, got {part.strip() or 'nothing'}") \
                from None
    return tuple(found)


def level_name(level: int) -> str:
    """What the training on one level is called."""
    return f"level {level}"


def _problem(path: str, rule: str) -> Problem:
    return Problem(where="", path=path, rule=rule)
