"""A folder of models to a dataset that plans: proposals, licences, files written aside, then put in place."""

import re
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from dataset_builder.errors import PlanError, Problem, UserError
from dataset_builder.files import output_errors
from dataset_builder.importing.find_models import PassedOver
from dataset_builder.importing.in_place import move, refuse_existing
from dataset_builder.importing.model_licence import FoundLicence
from dataset_builder.importing.proposal import Proposal, Proposals, Watch, propose
from dataset_builder.importing.spec_texts import spec_texts
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.precheck import PROBES
from dataset_builder.spec.licences import FREE, licence_of
from dataset_builder.spec.load import load_dataset

SHEET = "models.png"
"""The contact sheet, beside the dataset file."""
ASKED = "as asked"
"""Source of a licence that was given."""
Ask = Callable[[str], str]
Picture = Callable[[Path, Sequence[Proposal], Path], bool]
"""Draws the contact sheet of a dataset's models into a file; whether it could."""


@dataclass(frozen=True, kw_only=True)
class ImportJob:
    """What is asked for."""

    paths: tuple[Path, ...]
    out: Path
    licence: str = ""
    """SPDX identifier of the models that say none themselves."""
    dataset_licence: str = ""
    """Of the dataset, where none follows from its models."""
    category: str = ""
    """Of all models; empty to take it from their names."""

    @property
    def name(self) -> str:
        """Of the dataset: the output folder's, in the letters that a dataset's name may have."""
        return re.sub(r"[^a-z0-9]+", "-", self.out.resolve().name.lower()).strip("-")[:100] or "models"


@dataclass(frozen=True, kw_only=True)
class Imported:
    """What was written."""

    proposals: Proposals
    files: tuple[Path, ...]
    dataset: Path
    """The dataset file."""


def import_models(job: ImportJob, *, ask: Ask | None, picture: Picture | None, watch: Watch = iter) -> Imported:
    """Write an object spec for every model that can be read and planned, and a dataset of them.

    ask: gives the answer to a question, where there is somebody to ask. picture: draws the contact sheet, unless none
    is wanted. watch: shows how far reading is. Files are written beside the output folder and moved into it once the
    dataset has been planned. Raises UserError, with nothing written, where no model is left, a licence is not known, or
    a file is there already.
    """
    proposals = propose(job.paths, job.category, watch)
    if not proposals.made:
        raise UserError(_told(one) for one in proposals.left_out)
    proposals.made = _licensed(proposals.made, job.licence, ask)
    out = job.out.resolve()
    with output_errors(job.out):
        out.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=out.parent, prefix=f".{out.name}-") as folder:
            staging = Path(folder)
            names = [*_written(job, proposals, staging)]
            refuse_existing(job.out, [*names, *([SHEET] if picture else [])])
            if picture and picture(staging / f"{job.name}.yaml", proposals.made, staging / SHEET):
                names.append(SHEET)
            move(names, staging, out)
    return Imported(proposals=proposals, files=tuple(job.out / name for name in names),
                    dataset=job.out / f"{job.name}.yaml")


def _told(one: PassedOver) -> Problem:
    return Problem(where=str(one.path), path="", rule=f"left out: {one.reason}")


def _licensed(proposals: Sequence[Proposal], licence: str, ask: Ask | None) -> list[Proposal]:
    """The proposals, those that name no licence under the one that is given. Raises UserError that names every model
    without one."""
    known = {each.name: each.licence.spdx or licence for each in proposals}
    without = [each for each in proposals if not known[each.name]]
    if without and ask:
        listed = ", ".join(each.name for each in without)
        answer = ask(f"licence of {len(without)} models that name none ({listed}), an SPDX identifier: ").strip()
        known |= {each.name: answer for each in without}
    if wrong := {text for text in known.values() if not re.fullmatch(r"[A-Za-z0-9.+-]{0,100}", text)}:
        raise UserError([Problem(where="", path="--licence", rule="expected an SPDX identifier, such as CC-BY-4.0, got "
                                 f"{', '.join(sorted(wrong))}")])
    if without := [each for each in proposals if not known[each.name]]:
        raise UserError(Problem(where=str(each.model.path), path="licence",
                                rule=f"expected a licence, found none{_why(each)}",
                                hint=f"write it in {each.model.path.stem}.license.json or a LICENSE file beside the "
                                     "model, or give --licence for all that name none") for each in without)
    return [each if each.licence.spdx else _as_asked(each, known[each.name]) for each in proposals]


def _as_asked(each: Proposal, spdx: str) -> Proposal:
    """A proposal under the licence that was given; where several were found, a note says which."""
    doubt = [f"{each.licence.source}; taken as {spdx}, {ASKED}"] * bool(each.licence.source)
    return replace(each, licence=FoundLicence(spdx=spdx, source=ASKED), notes=(*each.notes, *doubt))


def _why(each: Proposal) -> str:
    return f": {each.licence.source}" if each.licence.source else ""


def _dataset_licence(job: ImportJob, parts: dict[str, str]) -> str:
    """What the dataset file has to say: nothing where its licence follows; where all models but free ones have the
    same, that one. Raises UserError where it has to be asked for."""
    found, why = licence_of(parts)
    asked = set(parts.values()) - {FREE}
    if job.dataset_licence or found:
        return job.dataset_licence
    if len(asked) == 1:
        return asked.pop()
    raise UserError([Problem(where="", path="--dataset-licence", rule="expected a licence of the dataset, since none "
                             f"follows from those of its models ({', '.join(sorted(set(parts.values())))}): {why}",
                             hint="give the SPDX identifier that it is to have")])


def _written(job: ImportJob, proposals: Proposals, staging: Path) -> dict[str, str]:
    """As `_planned`, with problems of files where they are going to lie."""
    try:
        return _planned(job, proposals, staging)
    except UserError as error:
        raise UserError(replace(problem, where=problem.where.replace(str(staging), str(job.out)))
                        for problem in error.problems) from error


def _planned(job: ImportJob, proposals: Proposals, staging: Path) -> dict[str, str]:
    """Write the files into `staging`; models of which no view can be planned are left out, the rest written again."""
    while True:
        licence = _dataset_licence(job, {each.name: each.licence.spdx for each in proposals.made})
        texts = spec_texts(proposals.made, name=job.name, licence=licence, parent=job.out.resolve().parent)
        shutil.rmtree(staging / "objects", ignore_errors=True)
        for name, text in texts.items():
            (staging / name).parent.mkdir(parents=True, exist_ok=True)
            (staging / name).write_text(text, encoding="utf-8")
        failing = _failing(staging / f"{job.name}.yaml")
        lost = [each for each in proposals.made if each.name in failing]
        proposals.made = [each for each in proposals.made if each.name not in failing]
        proposals.left_out += [PassedOver(path=each.model.path, reason=failing[each.name]) for each in lost]
        if not proposals.made:
            raise UserError(_told(one) for one in proposals.left_out)
        if not failing:
            return texts


def _failing(dataset: Path) -> dict[str, str]:
    """Names of models of which none of a few views can be planned, and why."""
    planner = Planner(load_dataset(dataset))
    tried, failed = dict[str, int](), dict[str, str]()
    for ref in planner.examples:
        pair = ref.view.pair
        split = next(split for split in planner.loaded.dataset.splits if split.name == pair.split)
        name = Path(split.objects.source[pair.object]).stem
        if tried.setdefault(name, 0) == PROBES or (tried[name] and name not in failed):
            continue
        tried[name] += 1
        try:
            planner.example(ref)
            failed.pop(name, None)
        except PlanError as error:
            problem = error.problems[0]
            failed[name] = f"cannot be planned: {problem.rule} ({problem.hint})"
    return failed
