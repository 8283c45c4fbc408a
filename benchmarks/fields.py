"""Neural fields of single objects: PSNR, CPU seconds, memory, and how their meshes differ from the clean ones.

Every field is made in a process of its own with one thread, as a build makes it, and its peak of memory counts. Meshes
are measured as those of every example are; noise on the same objects stands below, by the spec's own edge length.
Distances are in bounding radii, angles in degrees. Prints Markdown; no bound.
"""

import argparse
import json
import resource
import subprocess
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import _common as common

from dataset_builder.engine.made_by import field_versions
from dataset_builder.geometry.roughness import measure_roughness
from dataset_builder.label.example_plan import RoughPlan
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject
from dataset_builder.planning.catalogue import PairRef
from dataset_builder.planning.field_recipe import field_plan
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.rough_plan import rough_plan
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.rendering import plugins
from dataset_builder.rendering.backend import activate
from dataset_builder.rendering.field_maker import make_field
from dataset_builder.rendering.field_shelf import FieldProgress, FieldShelf, FieldTask
from dataset_builder.rendering.scene.triangle_soup import rough_twin
from dataset_builder.report.page_parts import markdown_table
from dataset_builder.seeding import rng
from dataset_builder.spec.field import FieldSpec
from dataset_builder.spec.load import load_dataset

OBJECTS = ("chair", "cabinet", "sofa", "plant", "vase", "glass_vase")
KINDS = ("density", "sdf")
SIGMAS = (0.001, 0.002, 0.004, 0.008)
SPLIT = "evaluation"
ROOT = common.MINI.parent
MEBIBYTE = 1 << 20
FIELD_HEAD = ("object", "field", "CPU s, images", "CPU s, fit", "peak MiB", "PSNR, dB", "worst, dB", "SSIM",
              "opacity IoU", "silhouette IoU", "bodies", "depth, 95%")
MESH_HEAD = ("object", "mesh", "triangles", "to clean, rms", "to clean, 95%", "to rough, rms", "normals, median",
             "normals, 95%", "volume", "area")


def planned(name: str) -> tuple[Planner, ObjectPlan]:
    """An object of the shipped specs, and the planner of a dataset that has it alone."""
    loaded = load_dataset(common.MINI, (f"splits.{SPLIT}.objects={{count: 1, from: [objects/{name}.yaml]}}",
                                        f"splits.{SPLIT}.pairs=1", f"rough.sigma=[{', '.join(map(str, SIGMAS))}]"))
    planner = Planner(loaded)
    return planner, planner.contents[SPLIT].objects[0]


def made(name: str, kind: str, options: argparse.Namespace) -> dict[str, Any]:
    """One field: its record, the figures of its mesh, seconds and memory."""
    activate("auto", 1)
    plugins.register()
    planner, target = planned(name)
    asked = FieldSpec(field=kind, views=options.views, held_out=options.held_out, size=options.size, spp=options.spp,
                      resolution=options.resolution, steps=options.steps)  # type: ignore[arg-type]
    field = field_plan(planner.loaded.dataset, asked, PairRef(split=SPLIT, object=0, scene=0), target, ROOT)
    clean, marks = asset_of(target, ROOT).mesh, {"images": process_time()}

    def told(news: FieldProgress) -> None:
        marks[news.stage] = process_time()

    with TemporaryDirectory() as folder:
        begin = process_time()
        shelf = FieldShelf(folder=Path(folder), made_by=field_versions("auto"))
        file = make_field(FieldTask(object=target, field=field), shelf, ROOT, told=told)
        end = process_time()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / MEBIBYTE
    found = measure_roughness(file.mesh, clean, rng(0))
    return {"object": name, "kind": kind, "images": marks["images"] - begin, "fit": end - marks["images"], "peak": peak,
            "record": file.record.model_dump(), "mesh": {"triangles": len(file.mesh.faces), **found.model_dump()}}


def noisy(name: str) -> list[list[str]]:
    """Rows of the same object with noise."""
    planner, target = planned(name)
    refs = [ref for ref in planner.examples if ref.view.pair.split == SPLIT][:len(SIGMAS)]
    clean = asset_of(target, ROOT).mesh
    return [mesh_row(name, f"sigma {sigma:g}", twin_figures(target, rough_plan(
        planner.loaded.dataset, ref, sigma, clean))) for ref, sigma in zip(refs, SIGMAS, strict=True)]


def twin_figures(target: ObjectPlan, plan: RoughPlan) -> dict[str, float]:
    """Of the rough twin of an object."""
    placed = PlacedObject(object=target, instance=1, position=(0.0, 0.0, 0.0), yaw=0.0)
    twin = rough_twin(placed, plan, ROOT)
    return {"triangles": len(twin.soup.corners), **twin.figures}


def field_row(one: dict[str, Any]) -> list[str]:
    """A field in the first table."""
    record = one["record"]
    return [one["object"], one["kind"], f"{one['images']:.1f}", f"{one['fit']:.1f}", f"{one['peak']:.0f}",
            f"{record['psnr']:.1f}", f"{record['psnr_worst']:.1f}", f"{record['ssim']:.3f}",
            f"{record['opacity_iou']:.3f}", f"{record['silhouette_iou']:.3f}",
            f"{record['bodies']} (and {record['bodies_dropped']})", f"{record['depth_95']:.3f}"]


def mesh_row(name: str, mesh: str, found: dict[str, float]) -> list[str]:
    """A mesh in the second table."""
    return [name, mesh, f"{found['triangles']:,}", f"{found['to_clean_rms']:.4f}", f"{found['to_clean_95']:.4f}",
            f"{found['to_rough_rms']:.4f}", f"{found['normal_median']:.1f}", f"{found['normal_95']:.1f}",
            f"{found['volume']:.3f}", f"{found['area']:.3f}"]


def told_apart(arguments: Sequence[str], name: str, kind: str) -> dict[str, Any] | str:
    """A field of a process of its own, or why there is none."""
    run = subprocess.run([sys.executable, __file__, *arguments, "--one", name, kind], capture_output=True, text=True,
                         check=False)
    lines = run.stdout.splitlines()
    return json.loads(lines[-1]) if run.returncode == 0 else (run.stderr.strip().splitlines() or ["no word"])[-1]


def main(arguments: Sequence[str]) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", nargs="+", default=OBJECTS, help="files of scene_specs/objects")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    for name, default in (("views", 100), ("held-out", 16), ("size", 128), ("spp", 64), ("resolution", 128),
                          ("steps", 300)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.one:
        print(json.dumps(made(*options.one, options)))
        return
    apart = partial(told_apart, list(arguments))
    fields, meshes = list[list[str]](), list[list[str]]()
    for name in options.objects:
        for kind in options.kinds:
            one = apart(name, kind)
            if isinstance(one, str):
                fields.append([name, kind, f"none: {one}", *[""] * (len(FIELD_HEAD) - 3)])
                continue
            fields.append(field_row(one))
            meshes.append(mesh_row(name, kind, one["mesh"]))
            print(f"made: {' '.join(fields[-1])}", file=sys.stderr, flush=True)
        meshes += noisy(name)
    print(f"{options.views} images of {options.size}x{options.size} at {options.spp} spp, {options.resolution} cells, "
          f"{options.steps} steps, {options.held_out} held out; one thread\n")
    print(markdown_table(FIELD_HEAD, fields) + "\n\n" + markdown_table(MESH_HEAD, meshes))


if __name__ == "__main__":
    main(sys.argv[1:])
