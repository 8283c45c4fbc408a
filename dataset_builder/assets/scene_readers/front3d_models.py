"""3D-FUTURE models of a 3D-FRONT scene: OBJ files under the names of their folders, brought to metres."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from dataset_builder.assets.asset import Asset
from dataset_builder.assets.file_model import FileModel
from dataset_builder.assets.mesh_file import scaled_world
from dataset_builder.assets.readers import obj
from dataset_builder.assets.scene_readers.front3d_json import FrontFurniture
from dataset_builder.assets.scene_readers.front3d_values import FaultNotes, cleaned, number
from dataset_builder.assets.scene_readers.thing_assets import thing_asset
from dataset_builder.digest import digest
from dataset_builder.errors import UserError
from dataset_builder.geometry.mesh import transform
from dataset_builder.spec.file_reference import is_inside
from dataset_builder.spec.front3d_references import MODEL_FILES, MODEL_LIST, front3d_document, model_file
from dataset_builder.spec.obj_references import READ_MAPS
from dataset_builder.spec.problems import shown
from dataset_builder.spec.wavefront import Statement

WORLD_FROM_FRONT = scaled_world(1.0, "y")
"""(4, 4): Y up to Z up."""
CENTIMETRE = 0.01
AGREES = 1.25
"""Ratio of sides, the shortest to the shortest and so on, up to which a model has its declared size; metres and
centimetres are a hundred apart."""
THINNEST = 0.05
"""Of the longest side: sides are compared as if they were at least this long."""
LONGEST = 10.0
"""Metres; no piece of furniture is longer, so that one without a declared size that is has centimetres."""
OFF_CENTRE, OFF_FLOOR = 0.05, 0.02
"""Metres of the middle of a model's base from its origin that are told, along the floor and in height."""
GLASS = ("4", "6", "7", "9")
"""Illumination models of glass, which these libraries give to wood."""


@dataclass(frozen=True, eq=False)
class FrontModel:
    """A model as it is placed."""

    asset: Asset
    """In metres, Z up, its origin where the file has it."""
    content: str
    """SHA-256 over all of it."""


@dataclass(eq=False)
class FrontModels:
    """The models of a folder, each read once."""

    folder: Path
    max_texture: int
    notes: FaultNotes
    _read: dict[str, FrontModel | None] = field(default_factory=dict)
    _placed: dict[tuple[str, float], FrontModel] = field(default_factory=dict)

    def model(self, piece: FrontFurniture, category: str) -> FrontModel | None:
        """The model of a piece of furniture in metres; None for one that is not there or cannot be read, which is
        noted."""
        jid = piece.jid
        if jid not in self._read:
            self._read[jid] = self._load(jid, category)
        read = self._read[jid]
        if read is None:
            return None
        unit, fault, said = metres_per_unit(read.asset.mesh.size, piece.sizes)
        if (jid, unit) not in self._placed:
            if fault:
                self.notes.add(fault, jid, said)
            self._placed[jid, unit] = self._in_metres(read, unit, jid)
        return self._placed[jid, unit]

    def _in_metres(self, read: FrontModel, unit: float, jid: str) -> FrontModel:
        mesh = transform(read.asset.mesh, np.diag([unit, unit, unit, 1.0])) if unit != 1 else read.asset.mesh
        low, high = mesh.bounds
        aside, raised = float(np.abs((low + high)[:2] / 2).max()), float(low[2])
        if aside > OFF_CENTRE or abs(raised) > OFF_FLOOR:
            self.notes.add("models off their origin, which is the middle of their base, placed as they are", jid,
                           f"{aside:.2f} m aside, {raised:.2f} m up")
        return FrontModel(replace(read.asset, mesh=mesh), digest({"model": read.content, "unit": unit}))

    def _load(self, jid: str, category: str) -> FrontModel | None:
        path = model_file(self.folder, jid)
        if path is None:
            self.notes.add("models that are not there, left out", jid, "neither " + " nor ".join(MODEL_FILES))
            return None
        try:
            model = self._file_model(path, jid)
            return FrontModel(*thing_asset(model, WORLD_FROM_FRONT, name=jid, category=category, licence=""))
        except UserError as error:
            self.notes.add("models that cannot be read, left out", f"{jid}/{path.name}", rule_of(error, self.folder))
            return None

    def _file_model(self, path: Path, jid: str) -> FileModel:
        """The OBJ file, in plain colours where its textures cannot be read, without light of its own and glass."""
        reset: dict[str, None] = {}

        def ignored(said: Statement) -> bool:
            if _matters(said):
                reset[said.key] = None
            return _glows(said)

        try:
            found = obj.read(path, self.max_texture, ignored=ignored)
        except UserError as error:
            found = obj.read(path, self.max_texture,
                             ignored=lambda said: _glows(said) or said.key.lower() in READ_MAPS)
            self.notes.add("models whose textures cannot be read, in plain colours", jid, rule_of(error, self.folder))
        if reset:
            self.notes.add("models that glow or are glass by their materials, which is reset", jid,
                           ", ".join(reset))
        return found


def _glows(said: Statement) -> bool:
    """Whether a statement of a library makes a material send out light or let it through."""
    key = said.key.lower()
    return key in ("ke", "map_ke", "tf") or (key == "illum" and said.rest.split()[:1] in [[each] for each in GLASS])


def _matters(said: Statement) -> bool:
    """Whether it says more than that nothing glows or shines through."""
    values = {number(word) for word in said.rest.split()}
    neutral = {"ke": [{0.0}], "tf": [{0.0}, {1.0}]}.get(said.key.lower(), [])
    return _glows(said) and values not in neutral


def rule_of(error: UserError, folder: Path) -> str:
    """What was wrong, without paths of this machine."""
    return error.problems[0].rule.replace(f"{folder}/", "")


def metres_per_unit(extents: Sequence[float], sizes: Sequence[Sequence[float]]) -> tuple[float, str, str]:
    """1 or 0.01, whichever brings a model's extents closest to a declared size; then the kind of fault, empty for none,
    and what is to be said of it.

    Sides are compared by length, since the order of axes differs between files. Where nothing is declared, what would
    be longer than 10 m has centimetres.
    """
    longest = max(extents)
    if not sizes:
        if longest <= LONGEST:
            return 1.0, "", ""
        return CENTIMETRE, "models without a declared size in centimetres, by their own size", f"{longest:.4g} long"
    declared = [np.array(size) * (CENTIMETRE if max(size) > LONGEST else 1) for size in sizes]
    fits = [(_misfit(np.array(extents) * unit, size), unit) for unit in (1.0, CENTIMETRE) for size in declared]
    _, unit = min(fits)
    said = f"{shown([float(f'{side:.4g}') for side in extents])}, declared {shown([list(size) for size in sizes])}"
    agreeing = {unit for found, unit in fits if found <= AGREES}
    if len(agreeing) != 1:
        return unit, "models whose size is not the declared one, the nearer of metres and centimetres taken", said
    if unit == CENTIMETRE:
        return unit, "models in centimetres, brought to metres", said
    if any(max(size) > LONGEST for size in sizes):
        return unit, "sizes declared in centimetres", said
    return unit, "", ""


def _misfit(extents: np.ndarray, size: np.ndarray) -> float:
    """Largest ratio between sides, at least 1."""
    one, other = (np.maximum(np.sort(sides), THINNEST * sides.max()) for sides in (extents, size))
    return float(np.exp(np.abs(np.log(one / other)).max()))


@dataclass(frozen=True)
class FrontCategory:
    """What the list of models says of one."""

    category: str
    """In lower case, with slashes without blanks (as ATISS has them); the category above it where there is none."""
    above: str
    """The category above it, such as `lighting`."""


def model_categories(folder: Path, notes: FaultNotes) -> dict[str, FrontCategory]:
    """Categories by jid; empty where there is no list, which is noted."""
    path = folder / MODEL_LIST
    try:
        document = front3d_document(path) if is_inside(folder, MODEL_LIST) and path.is_file() else None
    except (OSError, ValueError) as error:
        notes.add("lists of models that cannot be read; categories are the scene's own", MODEL_LIST,
                  str(error) if isinstance(error, ValueError) else type(error).__name__)
        return {}
    if not isinstance(document, list):
        notes.add("lists of models that are not there; categories are the scene's own", MODEL_LIST)
        return {}
    return categories_of(document)


def categories_of(entries: Sequence[Any]) -> dict[str, FrontCategory]:
    """Categories by jid of the entries of a list of models; what is no entry goes."""
    found = {}
    for entry in entries:
        if isinstance(entry, dict) and (jid := cleaned(entry.get("model_id"))):
            above = category_word(entry.get("super-category"))
            found[jid] = FrontCategory(category_word(entry.get("category")) or above, above)
    return found


def category_word(value: Any) -> str:
    """A category as things have it.

    >>> category_word("Three-Seat / Multi-seat Sofa"), category_word(None)
    ('three-seat/multi-seat sofa', '')
    """
    return cleaned(value).lower().replace(" / ", "/")
