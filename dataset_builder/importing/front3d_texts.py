"""The files of a proposed split of 3D-FRONT: scene specs, object specs and the dataset, each number with its reason."""

import json
import posixpath
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os.path import relpath
from pathlib import Path

from dataset_builder.errors import printable
from dataset_builder.importing.find_models import file_names
from dataset_builder.importing.front3d_split import PAPER, SplitChoice, SplitProposal, TargetChoice

VIEWS = {"train": (4, "the paper does not say; as many examples as the paper's 6,000 for evaluation"),
         "evaluation": (30, "section 5.1.1: thirty views of each object in each scene")}
"""Views of each (object, scene) pair, and why."""
HEAD = """\
# Written by `dataset-builder import front3d`; every line is yours to change.
# 3D-FRONT and 3D-FUTURE come under terms that are signed and that allow no passing on: keep what is built from them
# where their terms let it be.
"""
COMMON = """\
image: {width: 800, height: 800}  # section 5.1.1 of the paper: 800 x 800

# What LighTNet reads; nothing outside the object is traced
layers: {i_s: object, d: object, r: object, i_t: object, s_prime: object, mask: object}

render:
  spp: 256  # noise well below what networks learn from; `render.accuracy` asks for a bound instead

rough:
  # The paper adds random noise to each vertex of a subdivided mesh and does not say how much; radii of the bounding
  # sphere, from hardly seen to rough as a scan
  sigma: {log_uniform: [1e-3, 1e-2]}
  edge_length: 0.02  # metres; 2 cm is as fine as hand-held scans

camera:  # "randomly choose a viewpoint"
  fov: {uniform: [30, 60]}  # lenses of 62 to 31 mm on 36 mm film
  elevation: {uniform: [5, 45]}  # degrees; eyes of people who sit or stand
  azimuth: {uniform: [-180, 180]}
  coverage: [0.08, 0.6]  # of the frame: never a dot, never cut off

source:  # "uniform sunlight"
  dome: 1
  sun: {elevation: {uniform: [35, 80]}, azimuth: {uniform: [0, 360]}, irradiance: {uniform: [0.5, 1.5]}}

target:  # "randomly change the light source's position and increase the lighting energy"
  lights: {choice: [1, 1, 2, 3]}
  kinds: [area, sphere, spot, point]
  strength: {log_uniform: [1.5, 6]}  # times the source's
  temperature: {uniform: [2500, 8000]}  # kelvin; candle-like to overcast sky
  distance: {uniform: [1.0, 3.0]}  # metres; inside a room
  elevation: {uniform: [10, 80]}  # degrees; lamps stand or hang
  size: {uniform: [0.05, 0.5]}  # metres; bulbs to panels
  brightness: [0.6, 15]

storage: {dtype: float32, examples_per_shard: 32}

# To have things of the scenes themselves as targets, each where it stands: `objects: {things: {category: chair}, count:
# 1}` in place of `from`
"""


@dataclass(frozen=True, kw_only=True)
class Folders:
    """Where the data are, absolute, and the licence that they are under."""

    scenes: Path
    models: Path
    textures: Path | None
    licence: str
    """SPDX identifier."""


def split_texts(proposal: SplitProposal, scales: Mapping[str, tuple[float, str]], folders: Folders, *, name: str,
                out: Path, seed: int, share: float) -> dict[str, str]:
    """Text of every file by its path in the folder `out`, an absolute path that data are named from.

    scales: metres per unit of each target's file, and what told it. share: of the paper's views.
    """
    texts = dict[str, str]()
    names = _scene_names(proposal.splits)
    for split in proposal.splits:
        for scene in split.scenes:
            texts[f"scenes/{names[scene.file]}.yaml"] = _scene(scene.file, scene.uid, folders, out)
        for target in split.targets:
            texts[f"objects/{target.jid}.yaml"] = _object(target, split, *scales[target.jid], folders, out)
    texts[f"{name}.yaml"] = _dataset(proposal, names, folders.licence, name, seed, share)
    return texts


def _scene_names(splits: Sequence[SplitChoice]) -> dict[str, str]:
    files = [scene.file for split in splits for scene in split.scenes]
    return dict(zip(files, file_names(Path(file).stem for file in files), strict=True))


def _from(out: Path, path: Path) -> str:
    """A path as a file in a sub-folder of `out` names it, in quotes."""
    return json.dumps(posixpath.join("..", Path(relpath(path, out)).as_posix()), ensure_ascii=False)


def _scene(file: str, uid: str, folders: Folders, out: Path) -> str:
    textures = f"  textures: {_from(out, folders.textures)}\n" if folders.textures else ""
    return (f"# 3D-FRONT scene {printable(uid) or 'without a uid'}\n"
            f"file:\n  path: {_from(out, folders.scenes / file)}\n"
            f"  licence: {folders.licence}\n  models: {_from(out, folders.models)}\n{textures}"
            "# The target stands on free floor; `slot` lets it take the place of furniture\ntarget: floor\n")


def _object(target: TargetChoice, split: SplitChoice, scale: float, why: str, folders: Folders, out: Path) -> str:
    told = printable(target.told)
    if target.sizes:
        told += ", declared " + " x ".join(f"{side:g}" for side in target.sizes[0])
    met = "in none of another split" if target.strange else "in some of another split"
    return (f"# Target of {split.name}: {told}; stands in {target.scenes} of its {len(split.scenes)} scenes and {met}\n"
            f"file: {_from(out, folders.models / target.jid / target.file.name)}\n"
            f"category: {json.dumps(target.category)}\nlicence: {folders.licence}\n"
            f"scale: {scale:g}  # metres per unit of the file: {why}\nup: y\n"
            "# Libraries of these models make wood glow and shine through; scenes have it reset, too\n"
            "materials: {\"*\": {emission: [0, 0, 0], transmission: 0}}\n")


def _dataset(proposal: SplitProposal, names: Mapping[str, str], licence: str, name: str, seed: int,
             share: float) -> str:
    text = (f"{HEAD}name: {name}\nlicence: {licence}  # as that of the scenes and models\n"
            f"seed: {seed}  # what the split was drawn with, too\n\n{COMMON}splits:\n")
    for split in proposal.splits:
        scenes, targets = PAPER[split.name]
        views, why = VIEWS[split.name]
        fewer = f", {share:g} of them" if share != 1 else ""
        text += (f"  - name: {split.name}\n    objects:\n"
                 f"      count: {len(split.targets)}{_of(len(split.targets), targets)}\n      from:\n"
                 + "".join(f"        - objects/{target.jid}.yaml\n" for target in split.targets)
                 + f"    scenes:\n      count: {len(split.scenes)}{_of(len(split.scenes), scenes)}\n      from:\n"
                 + "".join(f"        - scenes/{names[scene.file]}.yaml\n" for scene in split.scenes)
                 + f"    pairs: all\n    views: {max(1, round(views * share))}  # {why}{fewer}\n    lights: 1\n")
    return text


def _of(there: int, wanted: int) -> str:
    return "  # as in the paper" if there == wanted else f"  # of the paper's {wanted}: there are no more"
