"""What is on the stage before anything is laid out: the room or scene with what is taken away, and the target where the
scene says where it stands."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dataset_builder.assets.asset import Asset
from dataset_builder.errors import PlanError
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject, RoomPlan
from dataset_builder.label.scene_source import SceneThingPlan
from dataset_builder.planning.catalogue import PairRef
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.planning.scene.contents import ScenePlan, SplitContents
from dataset_builder.planning.scene.footprints import Box, Footprint, footprint, overlap, standing
from dataset_builder.planning.scene.room_parts import ROOM_INSTANCE, room_parts
from dataset_builder.planning.scene.scene_models import SceneFacts, ThingFacts, scene_facts
from dataset_builder.planning.scene.things import Slot, left_out, placed_thing, slot_of, target_plan, unknown_names
from dataset_builder.spec.resolve import LoadedSpec

TARGET_INSTANCE = 1
FURNITURE_INSTANCE = 3
"""Value in the `instance` layer of the first thing or piece of furniture."""
FLOOR_SHARE = 0.1
"""Of its height that the corners of a box are looked for within."""
NAMED = 3
"""Things that a note names before it counts the rest."""


@dataclass(frozen=True, kw_only=True)
class Stage:
    """A room or scene of a pair, and its target."""

    room: RoomPlan
    target: ObjectPlan
    placed: PlacedObject | None = None
    """The target where it stands already; None where it is to be laid out."""
    notes: tuple[str, ...] = ()


def extent_of(asset: Asset) -> Box:
    """The box of an asset in its own frame."""
    low, high = asset.mesh.bounds.tolist()
    return Box(low=tuple(low), high=tuple(high))


def stage(loaded: LoadedSpec, split: SplitContents, pair: PairRef) -> Stage:
    """The stage of a pair. Raises PlanError for names that the scene does not have, and UserError where it cannot be
    read."""
    scene, mesh_root = split.scenes[pair.scene], loaded.path.parent
    target = target_plan(loaded, split, pair)
    if scene.file is None:
        return Stage(room=scene.room, target=target)
    facts = scene_facts(scene.room, mesh_root)
    if problems := tuple(unknown_names(loaded, scene, facts)):
        raise PlanError(problems)
    gone = left_out(scene, facts)
    if target.kind == "thing":
        return Stage(room=_furnished(scene, facts, gone | {target.thing}), target=target,
                     placed=placed_thing(target, mesh_root, TARGET_INSTANCE), notes=_slot_unused(scene))
    slot = slot_of(loaded, split, pair)
    if slot is None:
        return Stage(room=_furnished(scene, facts, gone), target=target)
    room = _furnished(scene, facts, gone | {slot.thing})
    placed = _in_slot(target, slot, mesh_root)
    return Stage(room=room, target=target, placed=placed, notes=_slot_notes(room, facts, slot, placed, mesh_root))


def _furnished(scene: ScenePlan, facts: SceneFacts, hidden: frozenset[str]) -> RoomPlan:
    """The room of a scene from a file: its size, and which of its things are there."""
    there = [thing for thing in facts.things if thing.name not in hidden]
    numbers = {thing.name: FURNITURE_INSTANCE + k
               for k, thing in enumerate(thing for thing in there if thing.role == "object")}
    things = tuple(SceneThingPlan(instance=numbers.get(thing.name, ROOM_INSTANCE), name=thing.name,
                                  category=thing.category, licence=thing.licence) for thing in there
                   if thing.name in numbers or thing.licence != scene.room.scene.file.licence)
    low, high = facts.box
    width, depth, height = (high - low).tolist()
    kept = tuple(thing.name for thing in facts.things if thing.name in hidden)
    return scene.room.model_copy(update={
        "width": width, "depth": depth, "height": height, "ceiling": any(thing.role == "ceiling" for thing in there),
        "scene": scene.room.scene.model_copy(update={"hidden": kept, "things": things})})


def _slot_unused(scene: ScenePlan) -> tuple[str, ...]:
    if scene.file is None or scene.file.slot is None:
        return ()
    return ("`slot` of the scene is not used: the target is one of its own things and stays where it stands",)


def _in_slot(target: ObjectPlan, slot: Slot, mesh_root: Path) -> PlacedObject:
    """The target where a thing stood that was taken away: over the middle of its footprint, turned as it was."""
    pose, yaw = standing(extent_of(asset_of(target, mesh_root)), np.array(slot.middle), slot.yaw, slot.base)
    return PlacedObject(object=target, instance=TARGET_INSTANCE, position=pose, yaw=yaw)


def _slot_notes(room: RoomPlan, facts: SceneFacts, slot: Slot, placed: PlacedObject,
                mesh_root: Path) -> tuple[str, ...]:
    """Which thing the target takes the place of, and what it runs into there that this one did not, by their boxes."""
    box = footprint(extent_of(asset_of(placed.object, mesh_root)), placed.position, placed.yaw)
    before = _box(next(thing for thing in facts.things if thing.name == slot.thing))
    hidden = set(room.scene.hidden)
    met = [thing.name for thing in facts.things if thing.name not in hidden and thing.role == "object"
           and overlap(box, _box(thing)) and not overlap(before, _box(thing))]
    building = RayScene([(part.positions, part.faces, part.instance) for part in room_parts(room, mesh_root)
                         if part.part != "furniture"])
    if _crosses(building, box) and not _crosses(building, before):
        met.append("the building")
    took = f"the target takes the place of {slot.thing}"
    if not met:
        return (took,)
    more = f" and {len(met) - NAMED} more" if len(met) > NAMED else ""
    return (f"{took}, but does not fit the free space there: its box meets {', '.join(met[:NAMED])}{more}",)


def _crosses(building: RayScene, box: Footprint) -> bool:
    """Whether surfaces part the corners of a box, its lower ones raised off the floor, from its middle."""
    rise = FLOOR_SHARE * (box.top - box.bottom)
    corners = np.array([[*corner, z] for corner in box.corners() for z in (box.bottom + rise, box.top - rise)])
    middle = np.array([*box.centre, (box.bottom + box.top) / 2])
    return bool(building.occluded(np.broadcast_to(middle, corners.shape), corners).any())


def _box(thing: ThingFacts) -> Footprint:
    (x, y, bottom), (right, back, top) = thing.low, thing.high
    return Footprint(centre=((x + right) / 2, (y + back) / 2), half=((right - x) / 2, (back - y) / 2), yaw=0.0,
                     bottom=bottom, top=top)
