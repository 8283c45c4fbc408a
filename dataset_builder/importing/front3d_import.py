"""A folder of 3D-FRONT scenes to an index, a report of faults, and the paper's split as specs that load."""

import csv
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from dataset_builder.errors import Problem, UserError, cell
from dataset_builder.files import output_errors
from dataset_builder.importing.find_models import file_names
from dataset_builder.importing.front3d_split import SplitProposal, propose_split
from dataset_builder.importing.front3d_texts import Folders, split_texts
from dataset_builder.importing.future_models import FutureModel, find_future_models
from dataset_builder.importing.in_place import move, refuse_existing
from dataset_builder.importing.index_file import IndexFile
from dataset_builder.importing.index_folder import FolderIndex, Watch, index_folder, made_by, scene_files
from dataset_builder.importing.scene_index import SceneIndex
from dataset_builder.importing.target_check import TargetCheck
from dataset_builder.spec.load import load_dataset

INDEX, SCENES, KINDS, FAULTS, SHEET = "index.jsonl", "scenes.csv", "faults.csv", "faults", "scenes.png"
"""Files and folders of the output, beside the specs."""
MISSING = "models that are not there, left out"
"""Kind of fault of a model that a scene says is published, once for a scene, as the reader of scenes has it."""


@dataclass(frozen=True, kw_only=True)
class Front3dJob:
    """What is asked for."""

    folder: Path
    """Of the scenes."""
    out: Path
    licence: str
    """SPDX identifier of scenes and models."""
    models: Path | None = None
    textures: Path | None = None
    model_info: Path | None = None
    index: Path | None = None
    """The index, where it is not to lie in the output folder."""
    workers: int = 1
    seed: int = 0
    share: float = 1.0
    """Of the paper's views."""

    @property
    def name(self) -> str:
        """Of the dataset: the output folder's, in the letters that a dataset's name may have."""
        return re.sub(r"[^a-z0-9]+", "-", self.out.resolve().name.lower()).strip("-")[:100] or "front3d"


Picture = Callable[[SplitProposal, Mapping[str, FutureModel], Path], bool]
"""Draws the sheet of the scenes of a proposal into a file; whether it could."""


@dataclass(frozen=True, kw_only=True)
class Front3dImported:
    """What was found and written."""

    index: FolderIndex
    models: Mapping[str, FutureModel]
    proposal: SplitProposal
    dataset: Path | None
    """The dataset file; None where there is no scene or no target for one."""
    files: tuple[str, ...]
    """Files and folders in the output folder, without the index."""


def import_front3d(job: Front3dJob, *, watch: Watch, picture: Picture | None) -> Front3dImported:
    """Index the scenes, report what is wrong with them, and write a proposal.

    Everything but the index is written aside and moved into place; the index is appended to as scenes are read, and
    taken up again. picture: draws the sheet, unless none is wanted. Raises UserError, before anything is read, for
    folders that are not there, a licence that is none, and files that are there already.
    """
    _check_licence(job.licence)
    scene_files(job.folder)
    models = find_future_models(job.models, job.model_info)
    if job.textures is not None and not job.textures.is_dir():
        raise UserError([Problem(where=str(job.textures), path="--textures", rule="expected a folder, found none")])
    refuse_existing(job.out, ["objects", "scenes", FAULTS, KINDS, SCENES, SHEET, f"{job.name}.yaml"])
    with IndexFile(job.index or job.out / INDEX, made_by()) as lines:
        index = index_folder(job.folder, lines, workers=job.workers, watch=watch)
        if models:
            index = replace(index, scenes=tuple(_with_missing(scene, models) for scene in index.scenes))
        check = TargetCheck()
        proposal = propose_split(index.scenes, models, seed=job.seed, check=check)
        ready = bool(proposal.splits) and all(split.targets for split in proposal.splits)
        out = job.out.resolve()
        out.parent.mkdir(parents=True, exist_ok=True)
        with output_errors(job.out), TemporaryDirectory(dir=out.parent, prefix=f".{out.name}-") as folder:
            staging = Path(folder)
            _write_report(lines, index.scenes, models, staging)
            names = [FAULTS, KINDS, SCENES]
            if ready and job.models is not None:
                names += _write_specs(job, job.models, proposal, check, staging)
            if picture and proposal.splits and picture(proposal, models, staging / SHEET):
                names.append(SHEET)
            move(names, staging, out)
    return Front3dImported(index=index, models=models, proposal=proposal, files=tuple(names),
                           dataset=job.out / f"{job.name}.yaml" if ready else None)


def _check_licence(licence: str) -> None:
    """Raises UserError where it is not given, or is no SPDX identifier."""
    why = ("3D-FRONT and 3D-FUTURE come under terms of use that are signed by mail and allow no passing on, for which "
           "there is no SPDX identifier; name them with a LicenseRef, such as --licence LicenseRef-3D-FRONT")
    if not licence:
        raise UserError([Problem(where="", path="--licence", rule="expected the licence of the scenes and models, got "
                                 "none", hint=why)])
    if not re.fullmatch(r"(LicenseRef-)?[A-Za-z0-9.+-]{1,89}", licence) or licence == "LicenseRef-":
        raise UserError([Problem(where="", path="--licence", rule="expected an SPDX identifier of letters, digits, "
                                 f". + and -, got {licence}", hint=why)])


def _write_specs(job: Front3dJob, models: Path, proposal: SplitProposal, check: TargetCheck,
                 staging: Path) -> list[str]:
    """Write the specs and see that they load; names of what was written."""
    folders = Folders(scenes=job.folder.resolve(), models=models.resolve(), licence=job.licence,
                      textures=job.textures and job.textures.resolve())
    texts = split_texts(proposal, check.scales, folders, name=job.name, out=job.out.resolve(), seed=job.seed,
                        share=job.share)
    for name, text in texts.items():
        (staging / name).parent.mkdir(parents=True, exist_ok=True)
        (staging / name).write_text(text, encoding="utf-8")
    try:
        load_dataset(staging / f"{job.name}.yaml")
    except UserError as error:
        raise UserError(replace(problem, where=problem.where.replace(str(staging), str(job.out)))
                        for problem in error.problems) from error
    return [*dict.fromkeys(name.partition("/")[0] for name in texts)]


def _write_report(lines: IndexFile, scenes: Sequence[SceneIndex], models: Mapping[str, FutureModel],
                  staging: Path) -> None:
    """A table of scenes, a table of faults by kind, and a file of faults for each scene that has any."""
    files = dict(zip((scene.file for scene in scenes), file_names(Path(scene.file).stem for scene in scenes),
                     strict=True))
    kinds = sorted({kind for scene in scenes for kind in scene.faults})
    (staging / FAULTS).mkdir()
    for scene, told in lines.told():
        rows = [(fault.kind, fault.where, fault.said) for fault in told]
        rows += [(MISSING, jid, "") for jid in (scene.missing(models) if models else ())]
        if scene.file in files and rows:
            _write_table(staging / FAULTS / f"{files[scene.file]}.csv", ("kind", "where", "said"), rows)
    _write_table(staging / KINDS, ("kind", "scenes", "times"), fault_counts(scenes))
    _write_table(staging / SCENES, ("file", "uid", "usable", "why_not", "rooms", "usable_rooms", "furniture",
                                    "furniture_with_model", "area_m2", "bytes", "faults", *kinds),
                 (_row(scene, models, kinds) for scene in scenes))


def _with_missing(scene: SceneIndex, models: Mapping[str, FutureModel]) -> SceneIndex:
    """A scene with models that are not there among its faults."""
    count = len(scene.missing(models))
    return replace(scene, faults={**scene.faults, MISSING: count}) if count else scene


def _row(scene: SceneIndex, models: Mapping[str, FutureModel], kinds: Sequence[str]) -> tuple[object, ...]:
    why = scene.unusable(models)
    return (scene.file, scene.uid, "no" if why else "yes", f"{why}: {scene.broken}" if scene.broken else why,
            len(scene.rooms), len(scene.usable(models)), sum(len(room.pieces) for room in scene.rooms),
            sum(1 for _ in scene.jids(models)), round(sum(room.area for room in scene.rooms), 2), scene.size,
            sum(scene.faults.values()), *(scene.faults.get(kind, 0) for kind in kinds))


def fault_counts(scenes: Iterable[SceneIndex]) -> list[tuple[str, int, int]]:
    """Kinds of faults with the number of scenes that have them, and how often they have; the most frequent first."""
    having, times = Counter[str](), Counter[str]()
    for scene in scenes:
        having.update(scene.faults.keys())
        times.update(scene.faults)
    return sorted(((kind, count, times[kind]) for kind, count in having.items()), key=lambda row: (-row[1], row[0]))


def _write_table(path: Path, head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with open(path, "w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(head)
        writer.writerows(map(cell, row) for row in rows)
