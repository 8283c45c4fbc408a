"""What the planned path depths lose of the light, and what planning them costs.

    python -m benchmarks.path_depths                              ten sheets of glass, an onion, fog of 3/m, mini rooms
    python -m benchmarks.path_depths --only fog --fog 1 3 5 --set 'image={width: 24, height: 24}'
    python -m benchmarks.path_depths --spec FILE --passes 0s 0t --set render.bias=0.05

Every pass is rendered twice along the same camera paths, cut at the planned number of edges and much longer ones: what
the longer paths add is the loss, without the noise of the light that both have. Roulette begins at the cut, so that
both are equal up to there. `bound` is what the plan promises of it at most; `target` and `frame` are the loss of the
image, or of raw lighting in the rough pass (letter r), on the object and on all pixels of the pass, with standard
errors from the spread of `--repeats` seeds. `planned` is CPU seconds of this example alone, all of planning and of path
depths in it. Exit code 1 where a loss exceeds `render.bias` by more than two standard errors.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any
from unittest import mock

import mitsuba as mi
import numpy as np
from scipy.spatial import ConvexHull

from benchmarks import _common as common
from benchmarks.transports.lit_pass import LitPass, OpenPass, passes_of
from dataset_builder.errors import PlanError
from dataset_builder.geometry.pinhole import sphere_lattice
from dataset_builder.planning.effects import decisions, light_left
from dataset_builder.planning.plan import plan_example
from dataset_builder.rendering.passes import channels_of, radiance_sampler
from dataset_builder.rendering.transport import integrator
from dataset_builder.rendering.transport.light_sampling import World
from dataset_builder.rendering.transport.path_tracer import PathStart, incident_radiance
from dataset_builder.spec.load import load_dataset
from tests.planning.scene.houses import box

DEEPER, DEEP = 4, 128
"""Times the planned edges, and the least number, that longer paths have."""
MINI = ("3t", "19t", "35t", "51t", "67t")
SPEC = """\
name: depths
seed: 5
image: {{width: 40, height: 40}}
layers: {{i_s: object, i_t: object, s_prime: object, mask: object}}
rough: {{sigma: 0.002, edge_length: 0.06}}
camera: {{fov: 45, elevation: 25, azimuth: 20, coverage: [0.03, 0.6], visibility: 0.3}}
source: {{dome: 1}}
target: {{lights: 1, kinds: [area], size: 0.3, strength: 4, distance: {distance}, elevation: 50, brightness: [0, 1000]}}
gates: {{mask_overlap: 0}}
splits: [{{name: train, objects: {{count: 1, from: [object.yaml]}}, scenes: {{count: 1, from: [scene.yaml]}}}}]
"""
ROOM = "width: 3.6\ndepth: 3.3\nheight: 2.6\nwindows: 1\n"
SCENE = "room: room.yaml\ntarget: floor\nfurniture: []\n"
GLASS = """\
file: glass.obj
category: glass
licence: CC0-1.0
up: z
materials: {glass: {plain: true, transmission: 1, roughness: 0, metallic: 0, base_color: [0.97, 0.98, 0.97], ior: 1.5}}
"""
Mesh = tuple[np.ndarray, np.ndarray]


def sheets(count: int = 10, thick: float = 0.03, apart: float = 0.05) -> list[Mesh]:
    """Level sheets of glass above each other, 60 cm wide."""
    return [box((-0.3, -0.3, apart * k), (0.3, 0.3, apart * k + thick))[:2] for k in range(count)]


def onion(shells: int = 4, radius: float = 0.25, thick: float = 0.02, apart: float = 0.05) -> list[Mesh]:
    """Hollow balls of glass in each other: cavities are wound inwards."""
    lattice = sphere_lattice(2000)
    faces = ConvexHull(lattice).simplices
    a, b, c = lattice[faces].transpose(1, 0, 2)
    outward = np.where((np.einsum("ij,ij->i", np.cross(b - a, c - a), a) > 0)[:, None], faces, faces[:, ::-1])
    middle = np.array([0, 0, radius])
    radii = [(radius - apart * k, way) for k in range(shells) for way in (1, -1)]
    return [(middle + (size - thick * (way < 0)) * lattice, outward[:, ::way]) for size, way in radii]


def obj_of(meshes: Sequence[Mesh]) -> str:
    """Meshes in one OBJ file, all of the material `glass`."""
    lines, first = ["mtllib glass.mtl", "usemtl glass"], 1
    for positions, faces in meshes:
        lines += ["v {:.6f} {:.6f} {:.6f}".format(*corner) for corner in positions]
        lines += ["f {} {} {}".format(*(face + first)) for face in faces]
        first += len(positions)
    return "\n".join([*lines, ""])


@dataclass(frozen=True, kw_only=True)
class Case:
    """Passes of a spec."""

    name: str
    spec: Path
    passes: tuple[str, ...]
    overrides: tuple[str, ...]


def made(folder: Path, given: argparse.Namespace) -> Iterator[Case]:
    """The made scenes, written to a folder, and rooms of the mini dataset."""
    def written(name: str, content: str, scene: str, distance: float, passes: tuple[str, ...]) -> Case:
        own = folder / name.replace("/", " per ")
        files = {"spec.yaml": SPEC.format(distance=distance), "room.yaml": ROOM, "scene.yaml": SCENE + scene,
                 "object.yaml": GLASS if content else "family: chair\n", "glass.obj": content,
                 "glass.mtl": "newmtl glass\n"}
        own.mkdir()
        for file, text in files.items():
            (own / file).write_text(text)
        return Case(name=name, spec=own / "spec.yaml", passes=passes, overrides=tuple(given.set))

    if given.spec:
        yield Case(name=given.spec.stem, spec=given.spec, passes=tuple(given.passes), overrides=tuple(given.set))
        return
    if "sheets" in given.only:
        yield written("ten sheets", obj_of(sheets()), "", 1.5, ("0s", "0t"))
    if "onion" in given.only:
        yield written("onion", obj_of(onion()), "", 1.5, ("0s", "0t"))
    for density in given.fog if "fog" in given.only else ():
        yield written(f"fog {density:g}/m", "", f"fog: {{extinction: {density}, albedo: 1}}\n", 0.7, ("0t",))
    if "mini" in given.only:
        size = "image={width: 40, height: 40}"
        yield Case(name="mini", spec=common.MINI, passes=MINI, overrides=(size, *given.set))


def planning(case: Case, index: int) -> tuple[float, float]:
    """CPU seconds of planning one example again, and of path depths in it; nothing is remembered of before."""
    spent, plain = [0.0], light_left.light_left

    def timed(**given: Any) -> light_left.LightLeft:
        begin = process_time()
        try:
            return plain(**given)
        finally:
            spent[0] += process_time() - begin

    light_left.LEFT.cache_clear()
    light_left.SURFACES.cache_clear()
    loaded = load_dataset(case.spec, case.overrides)
    with mock.patch.object(decisions, "light_left", timed):
        whole = common.seconds(lambda: plan_example(loaded, index), process_time)
    return whole, spent[0]


def from_the_start(world: World, sampler: mi.Sampler, start: PathStart, active: mi.Bool) -> mi.Color3f:
    """`incident_radiance` with random numbers that do not depend on how long the path before was: in fog a second one
    follows the first."""
    return incident_radiance(world, sampler.clone(), start, active)


def longer(found: LitPass, opened: OpenPass, spp: int, repeats: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """(P,) light of the pixels with planned and with longer paths, for each seed."""
    name = "shading" if found.letter == "r" else "image"
    view = replace(opened.view, render=opened.view.render.model_copy(update={"rr_depth": opened.max_depth}))
    channels = channels_of(frozenset({name}))[name]
    depths = (opened.max_depth, max(DEEP, DEEPER * opened.max_depth))
    samplers = [radiance_sampler(view, opened.scene, depth, "camera", wanted=frozenset({name})) for depth in depths]
    for seed in range(repeats):
        with mock.patch.object(integrator, "incident_radiance", from_the_start):
            cut, deep = (sample(opened.pixels, spp, 1, 100 + seed).mean[:, channels].sum(axis=1) for sample in samplers)
        if (cut > deep * (1 + 1e-5) + 1e-9).any():
            raise ValueError("expected longer paths to add light to the same ones, got pixels with less of it")
        yield cut, deep


def lost(pairs: Sequence[tuple[np.ndarray, np.ndarray]], chosen: np.ndarray) -> tuple[float, float]:
    """Share of the light of some pixels that only longer paths bring, and its standard error from the spread of seeds:
    of a ratio of means, as `light_left` has it."""
    missing, all_of_it = (np.array([values[chosen].sum() for values in side])
                          for side in ([deep - cut for cut, deep in pairs], [deep for _, deep in pairs]))
    share = missing.sum() / all_of_it.sum()
    deviation = missing - share * all_of_it
    return share, float(np.sqrt((deviation**2).sum() / len(pairs) / (len(pairs) - 1)) / all_of_it.mean())


def show(case: Case, found: LitPass, given: argparse.Namespace) -> bool:
    """Print one pass; whether it keeps what was asked for."""
    reason = next(each.reason for each in found.plan.effects.decisions
                  if each.effect == f"path depth of {found.kind}")
    bound = re.search(r"paths bring about \S+, at most (\S+) \(", reason)
    whole, depths = planning(case, int(found.name.split()[-1][:-1]))
    begin = process_time()
    with found.opened() as opened:
        pairs = list(longer(found, opened, given.spp, given.repeats))
        target = lost(pairs, opened.object)
        shown = [target, *([lost(pairs, np.ones(len(opened.pixels), bool))] if not opened.object.all() else [])]
        edges = opened.max_depth
    bias = load_dataset(case.spec, case.overrides).dataset.render.bias
    print(f"{case.name:12} {found.name.split()[-1]:>4} {edges:5} {bound[1] if bound else '-':>7} {bias:6.3f} "
          + " ".join(f"{100 * share:7.3f} +- {100 * error:.3f}%" for share, error in shown).ljust(38)
          + f" {whole:7.2f} ({depths:.2f}) {process_time() - begin:9.0f}", flush=True)
    return all(share - 2 * error <= bias for share, error in shown)


def main() -> int:
    """The table; exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=["sheets", "onion", "fog", "mini"])
    parser.add_argument("--fog", type=float, nargs="+", default=[3.0], help="extinctions of white fog, per metre")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=8)
    parser.add_argument("--spec", type=Path)
    parser.add_argument("--passes", nargs="+", default=["0s", "0t"])
    parser.add_argument("--set", action="append", default=[])
    given = parser.parse_args()
    common.start()
    print(f"{'scene':12} pass edges   bound   bias {'light lost: target':18} {'frame':19} planned, depths  CPU s")
    good = True
    with TemporaryDirectory() as folder:
        for case in made(Path(folder), given):
            for name in case.passes:
                try:
                    good &= show(case, next(iter(passes_of(case.spec, [name], case.overrides))), given)
                except PlanError as error:
                    print(f"{case.name:12} {name:>4} {error}", flush=True)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
