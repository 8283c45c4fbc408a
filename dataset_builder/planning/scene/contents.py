"""Contents of a split: its objects and its scenes, with every parameter drawn; no two splits share one unless
they say so."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import PurePosixPath
from posixpath import normpath
from typing import Any

from dataset_builder.assets.procedural.furniture import FINISHES
from dataset_builder.digest import digest
from dataset_builder.errors import PlanError, Problem
from dataset_builder.label.scene_plan import FogPlan, ObjectPlan, Param, RoomPlan
from dataset_builder.label.scene_source import PartPatterns, SceneFilePlan, SceneKind, SceneSource, VariantChoice
from dataset_builder.planning.scene.layout import Place
from dataset_builder.planning.scene.material_changes import drawn_changes, require_roles
from dataset_builder.planning.scene.room_finishes import room_materials
from dataset_builder.seeding import derive_seed, rng
from dataset_builder.spec.dataset import Shareable, SplitSpec
from dataset_builder.spec.families import FAMILIES, FamilyParam
from dataset_builder.spec.file_scene import SceneFileSpec, ThingQuery
from dataset_builder.spec.licences import FREE
from dataset_builder.spec.name_patterns import WILD
from dataset_builder.spec.numbers import AnyNumber, draw
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.spec.scene import FogSpec, ObjectSpec
from dataset_builder.spec.scene_files import FRONT_SUFFIX
from dataset_builder.spec.usd_references import USD_SUFFIXES

Path = tuple[str | int, ...]
CLEAR_AIR = FogPlan()


@dataclass(frozen=True, kw_only=True)
class PiecePlan:
    """A piece of furniture of a scene."""

    object: ObjectPlan
    place: Place
    number: tuple[int, int]
    """Entry of the scene, and copy."""


@dataclass(frozen=True, kw_only=True)
class ScenePlan:
    """A room and what stands in it, not yet placed: where things stand depends on the target among them."""

    room: RoomPlan
    furniture: tuple[PiecePlan, ...]
    target: Place
    space: float = 0.0
    """Metres of free floor about the target."""
    fog: FogPlan = CLEAR_AIR
    number: int
    """Counts the scenes of the split."""
    key: str
    """Of its scene spec."""
    file: SceneFileSpec | None = None
    """What the spec says of a scene from a file. What is in it shows when it is read; until then, sizes are 0."""


@dataclass(frozen=True, kw_only=True)
class SplitContents:
    """The objects and scenes of one split, by index."""

    name: str
    objects: tuple[ObjectPlan, ...]
    """None where the targets are things of the scenes; see `things.target_plan`."""
    scenes: tuple[ScenePlan, ...]
    things: ThingQuery | None = None
    """Which things of its scenes are targets, where they are."""
    count: int
    """Number of objects, of things in each scene."""
    allow_shared: tuple[Shareable, ...] = ()
    """What it may have in common with other splits."""


def _parameter(param: FamilyParam, given: AnyNumber | None, seed: int, path: Path) -> Param:
    value = draw(param.default if given is None else given, rng(seed, *path, "param", param.name))
    value = min(max(value, param.low), param.high)
    return Param(name=param.name, value=float(round(value)) if param.integer else value)


def object_plan(loaded: LoadedSpec, key: str, split: str, path: Path, number: int, role: str) -> ObjectPlan:
    """Draw the object of file `key`, whose numbers come from `path`, as `<split>-[<role>-]<category>-<number>`.

    Raises PlanError where it changes materials that its family never has.
    """
    spec, seed = loaded.objects[key], loaded.dataset.seed
    category = spec.category or (FAMILIES[spec.family].category if spec.family else "object")
    name = "-".join(filter(None, (split, role, category, f"{number:02d}")))
    shared: dict[str, Any] = {"name": name, "category": category, "licence": spec.licence or FREE,
                              "seed": str(derive_seed(seed, *path, "material")),
                              "materials": drawn_changes(spec.materials, seed, (*path, "materials"))}
    if spec.family is not None:
        require_roles(spec.materials, FINISHES[spec.family], key)
        params = tuple(_parameter(param, spec.params.get(param.name), seed, path)
                       for param in FAMILIES[spec.family].params)
        return ObjectPlan(kind="procedural", source=spec.family, source_sha256="", params=params, scale=1.0, up="z",
                          **shared)
    return _file_plan(loaded, spec, key, shared)


def _file_plan(loaded: LoadedSpec, spec: ObjectSpec, key: str, shared: dict[str, Any]) -> ObjectPlan:
    """A mesh file is named relative to the folder of the dataset file, as every file of the spec."""
    return ObjectPlan(kind="file", source=_source(spec, key), source_sha256=loaded.meshes[key].digest, params=(),
                      scale=spec.scale, up=spec.up, **shared)


def _source(spec: ObjectSpec, key: str) -> str:
    return normpath(PurePosixPath(key).parent / PurePosixPath(str(spec.file)))


def place_of(loaded: LoadedSpec, plan: ObjectPlan) -> str:
    """Where a spec names the mesh file of a planned object, `file:line`; empty for a family."""
    def drawn(scale: float, up: str, materials: Iterable[str]) -> tuple[float, str, tuple[str, ...]]:
        return scale, up, tuple(materials)

    wanted = drawn(plan.scale, plan.up, (change.name for change in plan.materials))
    return next((place for key, place in loaded.places.items() if (spec := loaded.objects[key])
                 and _source(spec, key) == plan.source and drawn(spec.scale, spec.up, spec.materials) == wanted), "")


def room_plan(loaded: LoadedSpec, key: str, name: str, path: Path) -> RoomPlan:
    """Draw the room of file `key`. Raises PlanError for materials that there are not."""
    spec, seed = loaded.rooms[key], loaded.dataset.seed

    def number(key: str) -> float:
        return draw(getattr(spec, key), rng(seed, *path, key))

    return RoomPlan(name=name, seed=str(derive_seed(seed, *path, "material")), width=number("width"),
                    depth=number("depth"), height=number("height"), ceiling=spec.ceiling, glazing=spec.glazing,
                    windows=round(number("windows")), skirting=number("skirting"),
                    materials=room_materials(spec.materials, loaded.images, seed, (*path, "materials"), key))


def fog_plan(spec: FogSpec | None, seed: int, path: Path) -> FogPlan:
    """Draw the fog of a scene; clear air where the spec has none."""
    if spec is None:
        return CLEAR_AIR
    return FogPlan(**{key: draw(getattr(spec, key), rng(seed, *path, key)) for key in FogPlan.model_fields})


def _scene_plan(loaded: LoadedSpec, split: str, index: int, key: str, things: ThingQuery | None) -> ScenePlan:
    spec, seed, path = loaded.scenes[key], loaded.dataset.seed, (split, "scene", index)
    pieces = list[PiecePlan]()
    for entry, furniture in enumerate(spec.furniture):
        for copy in range(round(draw(furniture.count, rng(seed, *path, "furniture", entry, "count")))):
            plan = object_plan(loaded, furniture.object, split, (*path, "furniture", entry, copy), len(pieces),
                               f"scene{index:02d}")
            pieces.append(PiecePlan(object=plan, place=furniture.place, number=(entry, copy)))
    name = f"{split}-room-{index:02d}"
    room = (_file_room(loaded, spec.file, key, name, things) if spec.file is not None else
            room_plan(loaded, str(spec.room), name, (*path, "room")))
    return ScenePlan(room=room, furniture=tuple(pieces), target=spec.target, space=spec.space,
                     fog=fog_plan(spec.fog, seed, (*path, "fog")), number=index, key=key, file=spec.file)


def _file_room(loaded: LoadedSpec, file: SceneFileSpec, key: str, name: str, things: ThingQuery | None) -> RoomPlan:
    """A scene from a file that has not been read. What a query names in full is one thing, a group of things, too."""
    suffix = PurePosixPath(file.path).suffix.lower()
    kind: SceneKind = "usd" if suffix in USD_SUFFIXES else "front3d" if suffix == FRONT_SUFFIX else "file"
    variants = tuple(VariantChoice(prim=prim, set=group, variant=variant)
                     for prim, chosen in file.variants.items() for group, variant in chosen.items())
    parts = [PartPatterns(part=part, patterns=patterns) for part, patterns in file.parts.items()]
    parts += [PartPatterns(part="object", patterns=(query.name,)) for query in (things, file.slot)
              if query is not None and not any(character in query.name for character in WILD)]
    source = SceneSource(source=file.path, source_sha256=loaded.scene_files[key].digest, licence=file.licence,
                         scale=file.scale, up=file.up, roots=file.roots, variants=variants, models=file.models,
                         textures=file.textures, parts=tuple(parts))
    return RoomPlan(name=name, seed="0", width=0.0, depth=0.0, height=0.0, ceiling=False, windows=0, skirting=0.0,
                    kind=kind, scene=SceneFilePlan(file=source))


def _in_turn(files: tuple[str, ...], count: int) -> list[str]:
    return [files[index % len(files)] for index in range(count)]


def split_contents(loaded: LoadedSpec, split: SplitSpec) -> SplitContents:
    """Draw the objects and scenes of a split; each depends on its own index only."""
    objects = tuple(object_plan(loaded, key, split.name, (split.name, "object", index), index, "")
                    for index, key in enumerate(_in_turn(split.objects.source, split.objects.count))
                    ) if split.objects.things is None else ()
    scenes = tuple(_scene_plan(loaded, split.name, index, key, split.objects.things)
                   for index, key in enumerate(_in_turn(split.scenes.source, split.scenes.count)))
    return SplitContents(name=split.name, objects=objects, scenes=scenes, things=split.objects.things,
                         count=split.objects.count, allow_shared=split.allow_shared)


def shape_digest(plan: ObjectPlan) -> str:
    """Digest of an object's geometry: two that differ in name and material only share it.

    A mesh file counts with all that it names, its textures included.
    """
    own = plan.model_dump(include={"kind", "params", "scale", "up"})
    return digest({**own, "source": plan.source_sha256 or plan.source})


def _object_digest(plan: ObjectPlan) -> str:
    materials = [change.model_dump() for change in plan.materials]
    return digest([shape_digest(plan), plan.seed if plan.kind == "procedural" else "", materials])


def scene_digest(plan: ScenePlan) -> str:
    """Digest of a room and what stands in it, or of a scene's file."""
    if plan.file is not None:
        return plan.room.scene.file.source_sha256
    room = plan.room.model_dump(exclude={"name"})
    return digest([room, sorted(_object_digest(piece.object) for piece in plan.furniture)])


def clashes(named: Iterable[tuple[str, str]], path: str, hint: str) -> list[Problem]:
    """One problem for every content (digest) that a second name has."""
    first, problems = dict[str, str](), list[Problem]()
    for name, content in named:
        if content in first:
            problems.append(Problem(where="", path=path, hint=hint,
                                    rule=f"expected {name} to differ from {first[content]}, got the same content"))
        first.setdefault(content, name)
    return problems


def contents(loaded: LoadedSpec) -> dict[str, SplitContents]:
    """Objects and scenes of every split, by its name.

    Raises PlanError where two objects or two scenes of a split are the same, or where splits share an object's shape
    or a scene and neither allows it; every clash is named.
    """
    drawn = {split.name: split_contents(loaded, split) for split in loaded.dataset.splits}
    problems = list[Problem]()
    for name, split in drawn.items():
        problems += clashes(((plan.name, _object_digest(plan)) for plan in split.objects), f"splits[{name}].objects",
                             "list more files, or lower the count")
    problems += across(drawn, lambda split: [(plan.name, shape_digest(plan)) for plan in split.objects], "objects",
                        "give each split its own files, or draw parameters from distributions")
    problems += across(drawn, lambda split: [(plan.room.name, scene_digest(plan)) for plan in split.scenes], "scenes",
                        "give each split its own scene files")
    if problems:
        raise PlanError(problems)
    return drawn


def across(drawn: Mapping[str, SplitContents], named: Callable[[SplitContents], list[tuple[str, str]]], path: Shareable,
           hint: str) -> list[Problem]:
    """Clashes between splits that do not allow them; repetitions within a split count once, under the first name."""
    once = list[tuple[str, str]]()
    for split in (each for each in drawn.values() if path not in each.allow_shared):
        once += {content: (name, content) for name, content in reversed(named(split))}.values()
    return clashes(once, path, hint)
