"""The datasets of a study, and the trainings on them: each on the first examples of a mix, measured on clean ones."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from dataset_builder.builder import Event, build
from dataset_builder.digest import digest
from dataset_builder.engine.local import run
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.methods.checkpoint import load_trained
from dataset_builder.lightnet.methods.method import choose
from dataset_builder.lightnet.results.evaluate import ScoreRow, contender, evaluate
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.lightnet.training.fit import LAST, TrainingJob
from dataset_builder.processes import cores
from dataset_builder.shards.reader import load_manifest
from dataset_builder.spec.load import load_dataset
from dataset_builder.studies.budget.arms import Arm, Mix
from dataset_builder.studies.budget.budget_study import BudgetStudy, first_examples
from dataset_builder.studies.trainings import SCORES, about, changed, claim, read_scores, train, write_scores

CACHE_SIZE = 32 * 10**9
"""Bytes of passes that mixes share: one with a pass raised takes all three from others."""


@dataclass(frozen=True, kw_only=True)
class ArmTraining:
    """One arm with one seed; picklable."""

    arm: Arm
    seed: int
    job: TrainingJob
    held_out: Path
    """The dataset to measure on."""
    split: str
    scores: Path
    """Folder of what was measured."""

    def __str__(self) -> str:
        return f"{self.arm.title}, seed {self.seed}"

    def identity(self) -> str:
        """What the scores depend on."""
        shards = [shard.sha256 for shard in load_manifest(self.held_out).shards]
        return digest({"training": self.job.identity(), "held_out": shards, "split": self.split})

    def kept(self) -> tuple[ScoreRow, ...]:
        """Scores of an earlier run; none where they are of another training, or missing."""
        return read_scores(self.scores / SCORES) if about(self.scores, self.identity()) else ()


def most_by_mix(arms: Sequence[Arm]) -> dict[Mix, int]:
    """How many examples of each mix its arms need."""
    return {mix: max(arm.examples for arm in arms if arm.mix == mix) for mix in dict.fromkeys(arm.mix for arm in arms)}


def build_all(study: BudgetStudy, arms: Sequence[Arm]) -> Iterator[tuple[str, Event]]:
    """Build the clean examples, then those of every mix, or go on with them: names of folders and news of the builds.

    They share the results of passes, so that nothing is rendered twice. Raises UserError as a build does.
    """
    wanted = {study.held_out: study.held_out_settings(),
              **{study.folder(mix): study.train_settings(mix, count) for mix, count in most_by_mix(arms).items()}}
    for folder, settings in wanted.items():
        for event in build(load_dataset(study.spec, settings), folder, backend=study.backend, workers=study.workers,
                           cache=study.out / "passes", cache_size=CACHE_SIZE):
            yield folder.name, event


def work_of(study: BudgetStudy, arms: Sequence[Arm]) -> list[ArmTraining]:
    """Every arm with every seed, one seed after the other; the datasets must be there."""
    counts, keys = most_by_mix(arms), dict[str, tuple[str, ...]]()
    for arm in arms:
        spec = load_dataset(study.spec, study.train_settings(arm.mix, counts[arm.mix])).dataset
        refused = {one.key for one in load_manifest(study.folder(arm.mix)).rejected}
        # What a gate refused was paid for all the same
        keys[arm.name] = tuple(sorted(set(first_examples(spec, arm.examples)) - refused))
    threads = 1 if workers_of(study) > 1 else 0
    seeds = range(study.training.seed, study.training.seed + study.size.seeds)
    return [ArmTraining(arm=arm, seed=seed, held_out=study.held_out, split=study.splits[1],
                        scores=study.out / "scores" / arm.name / f"seed-{seed}",
                        job=TrainingJob(dataset=study.folder(arm.mix), spec=_spec_of(study.training, arm, seed),
                                        out=study.out / "trainings" / arm.name / f"seed-{seed}", device=study.device,
                                        keys=keys[arm.name], threads=threads))
            for seed in seeds for arm in arms]


def train_all(study: BudgetStudy, work: Sequence[ArmTraining]) -> Iterator[ArmTraining]:
    """Train and measure what is missing, on a processor several at a time, each with a thread of its own; those that
    are done, in any order. Raises UserError as `fit` does."""
    missing = [one for one in work if not one.kept()]
    yield from (one for one in work if one not in missing)
    yield from run(train_one, missing, workers=min(workers_of(study), len(missing)))


def workers_of(study: BudgetStudy) -> int:
    """Trainings at a time: networks this small leave threads waiting for each other."""
    return study.workers or cores() if choose(study.device).type == "cpu" else 1


def train_one(one: ArmTraining) -> ArmTraining:
    """Train to the last step, and measure the last weights on every held-out example."""
    for _ in train(one.job):
        pass
    trained = contender(one.arm.name, load_trained(one.job.out / LAST, one.job.device))
    held_out = LightingDataset(one.held_out, one.split, one.job.spec.data)
    claim(one.scores, one.identity())
    write_scores(evaluate([trained], held_out, range(len(held_out))), one.scores / SCORES)
    return one


def _spec_of(spec: TrainingSpec, arm: Arm, seed: int) -> TrainingSpec:
    """With the arm's loss, without a split to check on, which datasets of mixes do not have, and with one checkpoint,
    at the end."""
    plain = spec.model_dump(exclude_unset=True)
    plain["data"] = {key: value for key, value in plain.get("data", {}).items() if key != "held_out"}
    plain |= {"seed": seed, "check": {"every": spec.steps, "patience": 0}}
    return changed(TrainingSpec.model_validate(plain), objective={"noise": arm.noise})
