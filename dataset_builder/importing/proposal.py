"""What is proposed for one model: its category, licence, scale and axis, and what is not honoured of its file."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from dataset_builder.assets.asset import Asset
from dataset_builder.assets.mesh_file import READERS, load_mesh_file
from dataset_builder.errors import UserError
from dataset_builder.importing.find_models import FoundModel, PassedOver, file_names, find_models
from dataset_builder.importing.model_licence import FoundLicence, info_of, licence_of_model
from dataset_builder.spec.mesh_source import MeshSource, companions, mesh_source
from dataset_builder.spec.usual_sizes import Lengths, category_of, size_advice, usual_of

Up = Literal["y", "z"]
UP: dict[str, Up] = {".stl": "z"}
"""Which axis is up by habit where the format does not say: z in CAD and for printers, y elsewhere."""
UNKNOWN = "object"


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """One object to be."""

    model: FoundModel
    source: MeshSource
    """The file and those that it names, with their digests."""
    name: str
    """Of its spec's file, without suffix."""
    category: str
    category_from: str
    """What told it, for people."""
    licence: FoundLicence
    scale: float
    """Metres per file unit."""
    up: Up
    size: Lengths
    """Width, depth and height at that scale, metres."""
    notes: tuple[str, ...] = ()
    """What to look at: sizes that are not usual and what is proposed about them, a category that was not found."""
    not_honoured: str = ""
    """What the file says and the renderer does not do."""
    contains: str = ""
    """What the file holds."""
    mended: str = ""
    """What was repaired."""


@dataclass(kw_only=True)
class Proposals:
    """What became of all files that were found."""

    made: list[Proposal] = field(default_factory=list)
    left_out: list[PassedOver] = field(default_factory=list)


Watch = Callable[[Sequence[FoundModel]], Iterable[FoundModel]]
"""Gives models back one by one."""


def propose(paths: Sequence[Path], category: str = "", watch: Watch = iter) -> Proposals:
    """Read every model and propose what its spec is to say; models that cannot be read, or are the same as another, are
    left out with the reason. category: of all of them, in place of what their names say. watch: shows how far it is.

    Raises UserError where a path is not there or none holds a model.
    """
    found, left = find_models(paths)
    names = file_names(model.title for model in found)
    proposals, first = Proposals(left_out=left), dict[str, Path]()
    for model, name in zip(watch(found), names, strict=True):
        try:
            proposal = _proposal(model, name, category)
        except UserError as error:
            said = [replace(problem, where=problem.where if problem.where != str(model.path) else "")
                    for problem in error.problems]
            proposals.left_out.append(PassedOver(path=model.path, reason="; ".join(map(str, said))))
        except (OSError, ValueError) as error:
            proposals.left_out.append(PassedOver(path=model.path, reason=f"cannot be read: {error}"))
        else:
            whole = first.setdefault(proposal.source.digest, model.path)
            if whole != model.path:
                proposals.left_out.append(PassedOver(path=model.path, reason=f"the same as {whole}"))
            else:
                proposals.made.append(proposal)
    return proposals


def _proposal(model: FoundModel, name: str, category: str) -> Proposal:
    """Raises UserError where the model cannot be read, or no scale makes sense of it."""
    suffix = model.path.suffix.lower()
    up = UP.get(suffix, "y")
    asset = load_mesh_file(model.path, name=name, category=category, licence="", up=up, max_texture=16)
    kind, told = (category, "as asked") if category else _category(model, asset)
    source = mesh_source(model.path, companions(model.path))
    made = Proposal(model=model, source=source, name=name, category=kind, category_from=told, scale=1.0, up=up,
                    licence=licence_of_model(model), size=asset.mesh.size, contains=asset.meta.get("contains", ""),
                    not_honoured=asset.meta.get("left_out", ""), mended=asset.meta.get("repair", ""))
    notes = [] if told else ["no category found: write what it is"]
    for _ in ("scale", "up"):
        advice = size_advice(made.size, category=kind, suffix=suffix, scale=made.scale, up=made.up)
        if advice is None:
            break
        notes.append(f"{advice.rule} ({advice.hint})")
        width, depth, height = made.size
        if advice.scale:
            factor = advice.scale / made.scale
            made = replace(made, scale=advice.scale, size=(width * factor, depth * factor, height * factor))
        else:
            made = replace(made, up="z" if made.up == "y" else "y", size=(width, height, depth))
    return replace(made, notes=tuple(notes))


def _category(model: FoundModel, asset: Asset) -> tuple[str, str]:
    """The category, and what told it; `object` and "" where nothing does."""
    for told, name in _names(model, asset):
        if usual_of(name):
            return category_of([name]), told
    return UNKNOWN, ""


def _names(model: FoundModel, asset: Asset) -> Iterator[tuple[str, str]]:
    """What may tell a category, from what tells most: the file's name, a `model_info.json`, folders from the nearest
    up, parts and materials of the file."""
    yield "file name", model.path.stem
    for folder in model.folders:
        entry = info_of(model, folder) or {}
        for key in ("category", "super-category"):
            if isinstance(entry.get(key), str):
                yield "model_info.json", entry[key]
    for folder in model.folders:
        yield "folder name", folder.name
    for part in READERS[model.path.suffix.lower()](model.path, 1).parts:
        yield "part name", part.name
    for material in asset.materials:
        yield "material name", material.name
