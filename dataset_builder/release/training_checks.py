"""Can a network learn from it? LighTNet, trained from scratch, must beat untrained baselines on the held-out split.

Two of the baselines get the true D and R, and multiply them with S'; what they miss is what the network is for: the
roughness of S', and speculars that S' does not contain. A fault of S' makes them worse, too, so that beating them alone
proves little. The third copies I_s, which no fault of S' touches: the network must leave it far behind.
"""

import shutil
from collections.abc import Generator, Sequence
from math import inf, isfinite
from pathlib import Path

from dataset_builder.errors import OutputError, Problem
from dataset_builder.files import output_errors
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.methods.baselines.trivial import TRIVIAL
from dataset_builder.lightnet.methods.checkpoint import load_trained
from dataset_builder.lightnet.results.clustered_means import ClusteredMean, estimate
from dataset_builder.lightnet.results.evaluate import ScoreRow, contender, evaluate, trivial
from dataset_builder.lightnet.training.events import Event
from dataset_builder.lightnet.training.fit import LAST, SPEC, TrainingJob, fit
from dataset_builder.release.dataset_check import Check, Rule

STEPS = 600
SETTINGS = ("model={width: 16, downs: 3}", "data={batch: 4, crop: 96, workers: 0}",
            "check={every: 1000000, examples: 8}", "optimiser.rate=2e-3", "objective.l1=1")
"""A LighTNet that two cores train on a hundred small pictures in minutes; checked once, at its end. Where the
feature loss is off, the Lab angle trades brightness away, which L1 holds."""
MARGIN, COPY_MARGIN = 0.5, 3.0
"""Decibels of mean PSNR that it must be ahead of each rival, and of the copy of I_s."""
COPY = "copy_i_s"
SIGMAS = 2.0
"""Standard errors that a difference must exceed."""


def ahead(name: str, margin: float) -> Rule:
    """The rule that a rival is beaten by a margin."""
    return Rule(name=f"beats_{name}", low=margin, why="set by --margin, and by --copy-margin for copy_i_s",
                statement=f"lead of mean PSNR over {name} on the held-out split, in dB")


def clearly(name: str) -> Rule:
    """The rule that it is not beaten by chance."""
    return Rule(name=f"clearly_{name}", low=SIGMAS, why="by chance in one of forty trainings that are no better",
                statement=f"the same over its standard error, example by example, clustered by view: {name}")


def training_checks(job: TrainingJob, *, margin: float, copy_margin: float) \
        -> Generator[Event, None, tuple[list[Check], list[ScoreRow]]]:
    """Train and compare; yields news of the training, returns checks and rows. Raises UserError as `fit` does.

    The job's folder is emptied where it holds an earlier training. The margins are in dB, see `compare`.
    """
    _start_afresh(job.out)
    yield from fit(job)
    # The last weights, not the best: those were chosen on the split that decides
    trained = load_trained(job.out / LAST, job.device)
    held_out = LightingDataset(job.dataset, job.spec.data.held_out, job.spec.data)
    rows = list(evaluate([contender(trained.name, trained), *trivial()], held_out, range(len(held_out))))
    return compare(rows, trained.name, margin=margin, copy_margin=copy_margin), rows


def compare(rows: Sequence[ScoreRow], method: str, *, margin: float, copy_margin: float) -> list[Check]:
    """Two checks for each rival: far enough ahead in PSNR, and by more than chance."""
    checks = []
    for name in TRIVIAL:
        lead = lead_over(rows, method, name)
        means = " against ".join(f"{mean_psnr(rows, one):.2f}" for one in (method, name))
        checks += [ahead(name, copy_margin if name == COPY else margin).judge(lead.mean, f"{means} dB"),
                   clearly(name).judge(_sureness(lead), f"{lead.mean:+.2f} ± {lead.error:.2f} dB, {lead.examples} "
                                                        f"examples of {lead.objects} views")]
    return checks


def lead_over(rows: Sequence[ScoreRow], method: str, other: str) -> ClusteredMean:
    """PSNR of a method less that of another, example by example; clusters are views.

    Not objects, of which held-out splits have a handful: this speaks of the split, not of furniture at large.
    """
    theirs = {row.key: row.metrics.psnr for row in rows if row.method == other}
    own = [row for row in rows if row.method == method]
    return estimate([row.metrics.psnr - theirs[row.key] for row in own], [row.view for row in own])


def mean_psnr(rows: Sequence[ScoreRow], method: str) -> float:
    """Of a method, in dB."""
    found = [row.metrics.psnr for row in rows if row.method == method]
    return sum(found) / len(found)


def _sureness(lead: ClusteredMean) -> float:
    """Lead over its standard error; none where there is but one view."""
    if not isfinite(lead.error):
        return 0.0
    return lead.mean / lead.error if lead.error > 0 else inf * (1 if lead.mean > 0 else -1)


def _start_afresh(out: Path) -> None:
    """Remove an earlier training. Raises OutputError where the folder holds something else."""
    with output_errors(out):
        if not out.exists() or not any(out.iterdir()):
            return
        if not (out / SPEC).is_file():
            raise OutputError([Problem(where=str(out), path="", hint="choose another --out",
                                       rule="expected an earlier training or nothing, got other files")])
        shutil.rmtree(out)
