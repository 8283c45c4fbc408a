"""The files of a dataset of imported models: object specs, a room with a scene, and the dataset."""

import json
import posixpath
from collections.abc import Sequence
from os.path import relpath
from pathlib import Path

from dataset_builder.errors import printable
from dataset_builder.importing.proposal import Proposal

EVERY = 5
"""One model in so many, sorted by category, is kept for evaluation."""
SCENES = {"train": 4, "evaluation": 2}
"""Rooms of a split, drawn from one file."""
FURNITURE = {"cabinet": "wall", "floor_lamp": "near", "plant": "near"}
"""Embedded furniture of the scene, by family, and where it stands."""
MOST_WIDE, MOST_HIGH = 100.0, 30.0
WALLS = """# Walls and a floor of your own, by colour, finish or picture; else they are drawn:
#materials: {wall: {base_color: "#c8d4c0"}, floor: {family: boards, tone: oak}}
"""
FRAME = """# The room in the pictures, too; else they hold the model's pixels alone:
#layers: [{i_s: frame, i_t: frame}, d, r, s_prime, mask]
"""
CAMERA = """# One camera before which the model turns, once round in `views` pictures; else cameras all about it.
# Lamps that are drawn stay as well with `lights_per: pair` in the split:
#camera: {path: {kind: turntable}}
"""
LAMP = """  # Or lamps where you put them, in place of `kinds`: metres from the middle of the floor, z upwards
  #lights: [{kind: area, position: [0, 0, HEIGHT], size: 0.4, strength: 3, temperature: 4000}]
"""
ALONE = """  # Pictures of the same model in other rooms, to measure on what was trained on this one:
  #- {name: evaluation, allow_shared: [objects], objects: {count: 1, from: [objects/NAME.yaml]}, SCENES}
"""
"""What may be written in place of what is drawn, as comments: `#` without a space stands before what counts."""


def spec_texts(proposals: Sequence[Proposal], *, name: str, licence: str, parent: Path) -> dict[str, str]:
    """Text of every file by its path in the output folder, which lies in `parent`. licence: of the dataset, empty where
    it follows from its objects."""
    texts = {f"objects/{each.name}.yaml": _object(each, parent) for each in proposals}
    texts |= {f"furniture/{family}.yaml": f"family: {family}\n" for family in FURNITURE}
    largest, highest = max(max(each.size) for each in proposals), max(each.size[2] for each in proposals)
    texts["rooms/room.yaml"] = _room(largest, highest)
    texts["scenes/room.yaml"] = "room: ../rooms/room.yaml\nfurniture:\n" + "".join(
        f"  - {{object: ../furniture/{family}.yaml, place: {place}}}\n" for family, place in FURNITURE.items())
    texts[f"{name}.yaml"] = _dataset(proposals, name, licence, largest, highest)
    return texts


def split_models(proposals: Sequence[Proposal]) -> dict[str, list[str]]:
    """Names of the models of each split: disjoint, categories spread over both; one model alone is for training.
    Models that differ in their textures only stay together."""
    groups: dict[str, list[str]] = {}
    for each in sorted(proposals, key=lambda each: (each.category, each.name)):
        groups.setdefault(each.source.sha256, []).append(each.name)
    ordered = [*groups.values()]
    held = ordered[EVERY // 2::EVERY] or ordered[1:2]
    splits = {"train": [group for group in ordered if group not in held], "evaluation": held}
    return {split: [name for group in own for name in group] for split, own in splits.items() if own}


def _object(proposal: Proposal, parent: Path) -> str:
    """An object file. Its mesh is named from the folder that the output folder lies in."""
    path = proposal.model.path.parent.resolve() / proposal.model.path.name
    mesh = posixpath.join("../..", Path(relpath(path, parent)).as_posix())
    about = [proposal.contains, *(f"look: {note}" for note in proposal.notes),
             f"not honoured: {proposal.not_honoured}" * bool(proposal.not_honoured)]
    lines = [f"# {printable(line)}" for line in about if line]
    lines += [f"file: {_text(mesh)}", f"category: {_text(proposal.category)}" + _comment(proposal.category_from),
              f"licence: {proposal.licence.spdx}" + _comment(proposal.licence.source)]
    if proposal.scale != 1:
        lines.append(f"scale: {proposal.scale:g}{_comment('proposed; metres per unit of the file')}")
    if proposal.up != "y" or any("`up:" in note for note in proposal.notes):
        lines.append(f"up: {proposal.up}{_comment('proposed; axis of the file that points up')}")
    return "\n".join(lines) + "\n"


def _text(value: str) -> str:
    """A string in quotes, as YAML and JSON have it."""
    return json.dumps(value, ensure_ascii=False)


def _comment(text: str) -> str:
    return f"  # {printable(text)}" if text else ""


def _room(largest: float, highest: float) -> str:
    """A room that the largest model fits into, with way to step back."""
    wide, high = min(max(4.5, 2.2 * largest + 1), MOST_WIDE), _lowest_ceiling(highest)
    across = _uniform(wide, min(wide + 1.5, MOST_WIDE))
    return (f"width: {across}\ndepth: {across}\n"
            f"height: {_uniform(high, min(high + 0.4, MOST_HIGH))}\nwindows: {{choice: [1, 2]}}\n" + WALLS)


def _lowest_ceiling(highest: float) -> float:
    """Of the room, metres."""
    return min(max(2.6, 1.3 * highest + 0.4), MOST_HIGH)


def _uniform(low: float, high: float) -> str:
    return f"{{uniform: [{low:.1f}, {high:.1f}]}}"


def _dataset(proposals: Sequence[Proposal], name: str, licence: str, largest: float, highest: float) -> str:
    near = max(1.2, 0.6 * largest)
    said = f"licence: {licence}\n" * bool(licence)
    text = (f"# Written by `dataset-builder import`; every line is yours to change.\nname: {name}\n{said}"
            "image: {width: 128, height: 128}\n" + FRAME + CAMERA +
            "rough: {sigma: {log_uniform: [2e-3, 8e-3]}}\n"
            f"target:\n  kinds: [area, sphere, spot, point]\n"
            f"{LAMP.replace('HEIGHT', f'{_lowest_ceiling(highest) - 0.3:.1f}')}"
            "  strength: {log_uniform: [1.5, 5]}\n"
            f"  temperature: {{uniform: [2700, 7500]}}\n  distance: {_uniform(near, 2 * near)}\n"
            "  elevation: {uniform: [15, 75]}\n"
            "gates: {mask_overlap: 0.5}\nsplits:\n")
    for split, names in split_models(proposals).items():
        files = "".join(f"        - objects/{each}.yaml\n" for each in names)
        text += (f"  - name: {split}\n    objects:\n      count: {len(names)}\n      from:\n{files}"
                 f"    scenes: {{count: {SCENES[split]}, from: [scenes/room.yaml]}}\n"
                 f"    pairs: {2 * len(names)}\n    views: 2\n")
    if len(proposals) == 1:
        scenes = f"scenes: {{count: {SCENES['evaluation']}, from: [scenes/room.yaml]}}"
        text += ALONE.replace("NAME", proposals[0].name).replace("SCENES", scenes)
    return text
