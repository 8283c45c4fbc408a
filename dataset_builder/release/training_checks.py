"""Can a network read it and learn from it? Every example as tensors, once; then LighTNet from scratch.

It must beat untrained baselines on the held-out split. Two of them get the true D and R, and multiply them with S';
what they miss is what the network is for: the roughness of S', and speculars that S' does not contain. A fault of S'
makes them worse, too, so that beating them alone proves little. The third copies I_s, which no fault of S' touches: the
network must leave it far behind.
"""

import shutil
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path
from time import perf_counter

import torch

from dataset_builder.errors import OutputError, Problem
from dataset_builder.files import output_errors
from dataset_builder.lightnet.data.batch import Batch
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset, measured, splits_of
from dataset_builder.lightnet.methods.checkpoint import load_trained
from dataset_builder.lightnet.methods.method import TRIVIAL
from dataset_builder.lightnet.results.clustered_means import ClusteredMean, estimate
from dataset_builder.lightnet.results.evaluate import ScoreRow, contender, evaluate, trivial
from dataset_builder.lightnet.settings import DataSpec
from dataset_builder.lightnet.training.events import Event
from dataset_builder.lightnet.training.fit import LAST, SPEC, TrainingJob, fit
from dataset_builder.release.dataset_check import Check, Rule
from dataset_builder.shards.reader import load_manifest

LIGHTING = (3, 9)
"""Shape of an example's light: channels, spherical harmonics up to degree 2."""

COUNTED = Rule(name="counted", high=0, why="every example that the manifest lists must be there",
               statement="examples of these splits in the manifest that the loader neither loads nor lists as left out")
LEFT_OUT = Rule(name="left_out", high=0.05, why="such an object is too thin to learn from; a few are allowed",
                statement="share of examples without a pixel inside")
FINITE = Rule(name="finite", high=0, why="one NaN ends a training",
              statement="examples with a tensor that is not finite or light below 0")
INSIDE = Rule(name="inside", low=1, why="losses and metrics are means over these",
              statement="pixels inside, minimum over examples")
LIGHTED = Rule(name="lighting", high=0, why="it is the only target light that two baselines see",
               statement="examples whose light is not 3 x 9 finite numbers, or has no light on average")

CEILING = Rule(name="noise_ceiling", low=-1, why="nothing may know the truth's noise; estimates are good to 1 dB",
               statement="PSNR of a perfect prediction against the noisy truth, less the best measured, in dB")
NO_NOISE = "no standard errors of an i_t that is not denoised: build with --set storage.standard_errors=true"

STEPS = 600
SETTINGS = ("model={width: 16, downs: 3}", "data={batch: 4, crop: 96, workers: 0}",
            "check={every: 1000000, examples: 8}", "optimiser.rate=2e-3", "objective.l1=1")
"""A LighTNet that two cores train on a hundred small pictures in minutes; checked once, at its end. Where the
feature loss is off, the Lab angle trades brightness away, which L1 holds."""
MARGIN, COPY_MARGIN = 0.5, 3.0
"""Decibels of mean PSNR that it must be ahead of each rival, and of the copy of I_s."""
COPY = "copy_i_s"
NO_OTHER = "the dataset has no split to hold out"
SIGMAS = 2.0
"""Standard errors that a difference must exceed."""


@dataclass(frozen=True, kw_only=True)
class Read:
    """What one example is like."""

    key: str
    finite: bool
    inside: int
    lighting: bool


def loader_checks(folder: Path | str, spec: DataSpec) -> list[Check]:
    """Every rule over the splits of a training. Raises UserError as `LightingDataset` and reading an example do."""
    spec = spec.among(splits_of(folder))
    sets = [LightingDataset(folder, split, spec) for split in (spec.train, spec.held_out) if split]
    start = perf_counter()
    found = [read(one[index]) for one in sets for index in range(len(one))]
    rate = len(found) / max(perf_counter() - start, 1e-9)
    left_out, notes = [key for one in sets for key in one.left_out], [note for one in sets for note in one.in_common]
    thinnest = min(found, key=lambda one: one.inside)
    return [COUNTED.judge(listed(folder, (spec.train, spec.held_out)) - len(found) - len(left_out),
                          "; ".join([", ".join(f"{one.split} {len(one)}" for one in sets), f"{rate:.0f} examples/s",
                                     *dict.fromkeys(notes)])),
            LEFT_OUT.judge(len(left_out) / (len(found) + len(left_out)), _named(left_out)),
            _count(FINITE, [one.key for one in found if not one.finite]),
            INSIDE.judge(thinnest.inside, f"example {thinnest.key}"),
            _count(LIGHTED, [one.key for one in found if not one.lighting])]


def listed(folder: Path | str, splits: Sequence[str]) -> int:
    """Examples that the manifest lists in some splits."""
    return sum(split.examples for split in load_manifest(folder).splits if split.name in splits)


def read(batch: Batch) -> Read:
    """What a batch of one is like."""
    inputs, truth = batch.inputs, batch.truth
    images = (inputs.i_s, inputs.s_prime, truth.i_t, truth.d, truth.r)
    lighting = tuple(inputs.sh.shape[1:]) == LIGHTING and bool(torch.isfinite(inputs.sh).all())
    return Read(key=batch.keys[0], inside=int(inputs.inside.sum()),
                finite=all(bool(torch.isfinite(image).all()) and bool((image >= 0).all()) for image in images),
                lighting=lighting and bool((inputs.sh[..., 0] > 0).all()))


def _count(rule: Rule, keys: Sequence[str]) -> Check:
    return rule.judge(len(keys), _named(keys))


def _named(keys: Sequence[str], most: int = 5) -> str:
    return ", ".join(keys[:most]) + (", ..." if len(keys) > most else "")


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

    The job's folder is emptied where it holds an earlier training. The margins are in dB, see `compare`. Where
    nothing is held out there is nothing to compare on, and nothing is trained.
    """
    data = job.spec.data.among(splits_of(job.dataset))
    if not data.held_out:
        rules = [rule for name in TRIVIAL for rule in (ahead(name, margin), clearly(name))]
        return [rule.pass_over(NO_OTHER) for rule in rules], []
    _start_afresh(job.out)
    yield from fit(job)
    # The last weights, not the best: those were chosen on the split that decides
    trained = load_trained(job.out / LAST, job.device)
    held_out = measured(job.dataset, data.held_out, data)
    rows = list(evaluate([contender(trained.name, trained), *trivial()], held_out, range(len(held_out))))
    return compare(rows, trained.name, margin=margin, copy_margin=copy_margin), rows


def compare(rows: Sequence[ScoreRow], method: str, *, margin: float, copy_margin: float) -> list[Check]:
    """Two checks for each rival: far enough ahead in PSNR, and by more than chance."""
    checks = [_below_ceiling(rows, method)]
    for name in TRIVIAL:
        lead = lead_over(rows, method, name)
        means = " against ".join(_psnr_text(rows, one) for one in (method, name))
        checks += [ahead(name, copy_margin if name == COPY else margin).judge(lead.mean, means),
                   clearly(name).judge(_sureness(lead), _counted(lead))]
    return checks


def _below_ceiling(rows: Sequence[ScoreRow], method: str) -> Check:
    if not rows[0].noise_known:
        return CEILING.pass_over(NO_NOISE)
    perfect, best = mean_psnr(rows, method, "ceiling"), max(mean_psnr(rows, one) for one in (method, *TRIVIAL))
    return CEILING.judge(perfect - best, f"{perfect:.2f} against {best:.2f} dB")


def lead_over(rows: Sequence[ScoreRow], method: str, other: str) -> ClusteredMean:
    """PSNR of a method less that of another, example by example; clusters are views.

    Not objects, of which held-out splits have a handful: this speaks of the split, not of furniture at large.
    """
    theirs = {row.key: row.metrics.psnr for row in rows if row.method == other}
    own = [row for row in rows if row.method == method]
    return estimate([row.metrics.psnr - theirs[row.key] for row in own], [row.view for row in own])


def mean_psnr(rows: Sequence[ScoreRow], method: str, part: str = "metrics") -> float:
    """Of a method, in dB. part: of `ScoreRow`, as it was measured, corrected, or of the ceiling."""
    found = [getattr(row, part).psnr for row in rows if row.method == method]
    return sum(found) / len(found)


def _psnr_text(rows: Sequence[ScoreRow], method: str) -> str:
    """As it was measured, and without the truth's noise."""
    without = f" ({mean_psnr(rows, method, 'corrected'):.2f} without noise)" if rows[0].noise_known else ""
    return f"{mean_psnr(rows, method):.2f} dB{without}"


def _sureness(lead: ClusteredMean) -> float:
    """Lead over its standard error; none where there is but one view."""
    if not isfinite(lead.error):
        return 0.0
    return lead.mean / lead.error if lead.error > 0 else inf * (1 if lead.mean > 0 else -1)


def _counted(lead: ClusteredMean) -> str:
    if lead.objects == 1:
        return f"{lead.mean:+.2f} dB, {lead.examples} examples, all of one view: no standard error over views"
    return f"{lead.mean:+.2f} ± {lead.error:.2f} dB, {lead.examples} examples of {lead.objects} views"


def _start_afresh(out: Path) -> None:
    """Remove an earlier training. Raises OutputError where the folder holds something else."""
    with output_errors(out):
        if not out.exists() or not any(out.iterdir()):
            return
        if not (out / SPEC).is_file():
            raise OutputError([Problem(where=str(out), path="", hint="choose another --out",
                                       rule="expected an earlier training or nothing, got other files")])
        shutil.rmtree(out)
