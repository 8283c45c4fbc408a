"""The study of noise: one spec at several levels, built as any dataset is, and how often each pass ran for it."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from dataset_builder.builder import Event, build
from dataset_builder.engine.field_tasks import FieldNews
from dataset_builder.errors import Problem, UserError
from dataset_builder.layers import PAPER_LAYERS
from dataset_builder.lightnet.data.truth import problem_of
from dataset_builder.lightnet.methods.vgg import check_file
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.planning.catalogue import ExampleRef, examples
from dataset_builder.shards.folder import SECONDS
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.studies.comma_separated import read_csv
from dataset_builder.studies.noise.axes import DEFAULT, SHADING, axis_of
from dataset_builder.studies.noise.study_levels import StudyLevel, overrides_of, problems_of
from dataset_builder.studies.trainings import changed, settings_of

NO_PASSES = ("plan", "encode", "denoise")
"""Stages that trace nothing."""
MEANINGS = {
    "first_hit": "light-free layers", "source": "I_s", "target": "I_t", "rough": "S'",
    "first_hit_rough": "where the rough mesh is seen", "lighting": "spherical harmonics of the target light",
    "instance": "instances", "empty": "the scene without the object", "pbr": "the scene with the rough mesh in it",
    "rough_direct": "S' without bounced light, for denoising",
}


@dataclass(frozen=True, kw_only=True)
class NoiseStudy:
    """What to study."""

    spec: Path
    overrides: tuple[str, ...]
    levels: tuple[StudyLevel, ...]
    """Noise, sigma rising, then fields; see `parse_levels`."""
    training: TrainingSpec
    """LighTNet on all levels of noise, made by `studies.trainings.base_of`."""
    per_level_steps: int
    """Batches of each training that sees one level."""
    out: Path
    """The study's folder."""
    backend: str = "auto"
    workers: int | None = None
    """Processes that render, None for one per core."""
    vgg_weights: Path | None = None
    device: str = "auto"
    x: str = ""
    """What curves are drawn over, a name of `AXES`; empty takes what suits the levels."""
    fields_alone: bool = True
    """Whether levels of fields have trainings of their own, too."""

    @property
    def dataset(self) -> Path:
        """Where the dataset is built."""
        return self.out / "dataset"

    @cached_property
    def loaded(self) -> LoadedSpec:
        """The spec at all levels. Raises SpecError."""
        return load_dataset(self.spec, (*self.overrides, *overrides_of(self.levels)))

    @property
    def axis(self) -> str:
        """What curves are drawn over. A mesh from a field is much farther from the clean one than noise that tilts
        normals as much: what both do to S' can be compared."""
        return self.x or (DEFAULT if self.noise == tuple(range(len(self.levels))) else SHADING)

    @property
    def noise(self) -> tuple[int, ...]:
        """Numbers of the levels that are noise on the clean mesh."""
        return tuple(number for number, level in enumerate(self.levels) if level.noise)

    @property
    def alone(self) -> tuple[int, ...]:
        """Numbers of the levels that have a training of their own."""
        return tuple(number for number, level in enumerate(self.levels) if level.noise or self.fields_alone)

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
    axis_of(study.axis)
    # What is wrong with the levels would be told of their spec in other words
    problems = problems_of(study.levels) or list(_lacking(study))
    if problems:
        raise UserError(problems)
    if study.vgg_weights and study.training.objective.fr:
        check_file(study.vgg_weights)


def _lacking(study: NoiseStudy) -> Iterator[Problem]:
    """What the dataset's spec lacks for the study."""
    dataset = study.loaded.dataset
    data = study.training.data.among([split.name for split in dataset.splits])
    if lacking := problem_of("", dataset.layers, PAPER_LAYERS, "train on and to measure by"):
        yield lacking
    splits = {split.name: split for split in dataset.splits}
    for name in (data.train, data.held_out or "to measure on"):
        if name not in splits:
            yield Problem(where="", path="splits", rule=f"expected a split {name}, got {', '.join(splits)}")
        elif splits[name].source.mesh:
            yield Problem(where="", path=f"splits.{name}.source.gives", rule="expected [i_s], since rough meshes are "
                          "the levels of the study, got r3dm besides")


def make(study: NoiseStudy, told: Callable[[FieldNews], None] = lambda news: None) -> Iterator[Event]:
    """Build the dataset at all levels, or go on with it; news as of any build, `told` included. Raises UserError as a
    build does."""
    require(study)
    yield from build(study.loaded, study.dataset, backend=study.backend, workers=study.workers, told=told)


def level_name(level: int) -> str:
    """What the training on one level is called."""
    return f"level {level}"


@dataclass(frozen=True, kw_only=True)
class PassCount:
    """How often one pass ran."""

    name: str
    ran: int
    """Times that the pass was rendered for `examples` examples."""
    examples: int
    seconds: float
    """Of all of them together."""
    per: str
    """What it ran once for, empty where that cannot be said."""
    once: bool
    """Whether it was shared by all noise levels."""

    @property
    def meaning(self) -> str:
        """What it makes."""
        return MEANINGS.get(self.name, self.name)


def count_passes(study: NoiseStudy) -> list[PassCount]:
    """Every pass that ran for the dataset, the shared ones first. Examples that a gate rejected are counted, too: their
    passes ran."""
    refs = {ref.key: ref for ref in examples(study.loaded.dataset)}
    ran, seconds = Counter[str](), defaultdict[str, float](float)
    made = dict[str, ExampleRef]()
    for line in read_csv(study.dataset / SECONDS):
        key, step = line["key"], line["step"]
        if key in refs and step not in NO_PASSES:
            made[key] = refs[key]
            ran[step] += 1
            seconds[step] += float(line["seconds"])
    found = [_count(name, ran[name], seconds[name], list(made.values())) for name in ran]
    return sorted(found, key=lambda one: (not one.once, one.ran))


def pass_lines(counts: Sequence[PassCount]) -> list[str]:
    """One line for each pass, and what sharing saved."""
    lines = [f"{one.name} ({one.meaning}): ran {one.ran} times for {one.examples} examples{one.per and ', '}{one.per}, "
             f"{one.seconds:.1f} s" for one in counts]
    return [*lines, shared_passes(counts)]


def shared_passes(counts: Sequence[PassCount]) -> str:
    """What rendering every example apart would have taken, by what its passes took here."""
    shared = sum(one.seconds for one in counts)
    apart = sum(one.seconds * one.examples / one.ran for one in counts)
    repeated = [one.name for one in counts if not one.once]
    return (f"{', '.join(repeated) or 'no pass'} ran again for each noise level; all passes took {shared:.1f} s, and "
            f"would have taken {apart:.1f} s if each example had been rendered separately")


def _count(name: str, ran: int, seconds: float, made: Sequence[ExampleRef]) -> PassCount:
    views, lights = len({ref.view for ref in made}), len({(ref.view, ref.light) for ref in made})
    # Where counts are equal, as with one light per view, the first that fits is told
    meanings = ((views, "once per view"), (lights, "once per view and light"), (len(made), "once per example"))
    per = next((text for count, text in meanings if count == ran), "")
    return PassCount(name=name, ran=ran, examples=len(made), seconds=seconds, per=per, once=ran <= lights)
