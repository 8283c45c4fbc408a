"""A folder of models as this builder reads them against Blender's importers: albedo and mask at the same pose.

    python benchmarks/against_importers.py FOLDER --blender-python PYTHON    an environment that has bpy 5
    python benchmarks/against_importers.py FOLDER --cache FOLDER             makes one in FOLDER/bpy with pip

Every .gltf .glb .obj .ply .stl .usd* below FOLDER is rendered by both from the same camera: our layers `d` and `mask`,
with specular, coat and sheen off; Blender's base colour times (1 - metallic) times (1 - transmission), shown as an
emission by Cycles. Without gloss, neither depends on the light, so it is that of an even dome. One line per model says
how alike they are, and exit code 1 that one differs. What a file leaves open may differ by right: a file without
materials or colours has our documented grey on both sides.
"""

import argparse
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import OpenEXR
from cycles.client import Blender, make_environment
from importers.comparison import Likeness, Picture, compare, print_table, write_csv
from importers.our_side import OurPicture, our_picture

from dataset_builder.errors import UserError
from dataset_builder.rendering.backend import activate
from dataset_builder.tonemap import side_by_side

SIDE = Path(__file__).with_name("importers") / "blender_import.py"
SUFFIXES = (".gltf", ".glb", ".obj", ".ply", ".stl", ".usd", ".usda", ".usdc", ".usdz")

FAULTS = (ArithmeticError, AttributeError, LookupError, MemoryError, OSError, RuntimeError, TypeError, ValueError)
"""What must not come out of a reader, and is a line of the table rather than the end of it."""


class Importers:
    """Blender's side; a file that ends its process costs no other."""

    def __init__(self, python: Path, threads: int, folder: Path):
        self._python, self._threads, self._out = python, threads, folder / "theirs.exr"
        self._blender = Blender(python, threads, SIDE)
        self.version = self._blender.version

    def picture(self, path: Path, ours: OurPicture, *, size: int, spp: int) -> tuple[Picture | None, str]:
        """What Blender shows of a file, None for nothing, and what it says."""
        try:
            found = self._blender.ask(path=str(path.resolve()), extents=ours.extents, camera=ours.camera, size=size,
                                      spp=spp, out=str(self._out))
        except (RuntimeError, OSError) as error:
            self.close()
            self._blender = Blender(self._python, self._threads, SIDE)
            return None, str(error).strip().splitlines()[-1]
        if "error" in found:
            return None, str(found["error"]).strip().splitlines()[-1]
        with OpenEXR.File(str(self._out)) as file:
            channels = file.channels()
            pixels = np.array(channels["RGBA"].pixels)
        albedo = pixels[..., :3] / np.maximum(pixels[..., 3:], 1e-6)
        picture = Picture(albedo=albedo, mask=pixels[..., 3], extents=np.array(found["extents"]))
        return picture, "; ".join(found["notes"])

    def close(self) -> None:
        """End Blender's process."""
        self._blender.__exit__(None, None, None)


def models_below(folder: Path) -> list[Path]:
    """Every model file in a folder and its folders, in order."""
    return sorted(path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file())


def likenesses(given: argparse.Namespace, importers: Importers, folder: Path) -> Iterator[Likeness]:
    """Each model in turn; pictures of both go where they were asked for."""
    for path in models_below(given.folder):
        name = path.relative_to(given.folder).as_posix()
        try:
            ours = our_picture(path, folder, size=given.size, spp=given.spp, azimuth=given.azimuth)
        except UserError as error:
            yield Likeness(model=name, ours=error.problems[0].rule)
            continue
        except FAULTS as error:
            yield Likeness(model=name, ours=f"a fault of this builder: {error!r}")
            continue
        theirs, said = importers.picture(path, ours, size=given.size, spp=given.spp)
        if theirs is None:
            yield Likeness(model=name, theirs=said)
            continue
        if given.pictures:
            given.pictures.mkdir(parents=True, exist_ok=True)
            _draw(given.pictures / f"{name.replace('/', '_')}.png", ours.picture, theirs)
        yield compare(name, ours.picture, theirs, said)


def _draw(path: Path, *sides: Picture) -> None:
    """Both, in front of black."""
    from PIL import Image

    shown = [(side.albedo * side.mask[..., None]).astype(np.float32) for side in sides]
    Image.fromarray(side_by_side(shown)).save(path)


def arguments() -> argparse.Namespace:
    """What the command line says."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path, nargs="?", help="of models, with folders of its own")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--blender-python", type=Path, help="Python of an environment that has bpy 5")
    where.add_argument("--cache", type=Path, help="folder to keep such an environment in")
    parser.add_argument("--size", type=int, default=128, help="pixels along a side (default 128)")
    parser.add_argument("--spp", type=int, default=64, help="samples per pixel on both sides (default 64)")
    parser.add_argument("--azimuth", type=float, default=35, help="degrees that the camera stands from the front")
    parser.add_argument("--threads", type=int, default=2, help="of both sides (default 2)")
    parser.add_argument("--csv", type=Path, help="also write the figures here")
    parser.add_argument("--pictures", type=Path, help="also draw both sides of every model into this folder")
    return parser.parse_args()


def main() -> int:
    """Print the table; exit code 1 where a model differs."""
    given = arguments()
    if not given.folder or not (given.blender_python or given.cache):
        print("not run: give a folder of models, and --blender-python PYTHON of an environment with bpy, or --cache "
              "FOLDER to make one in")
        return 0
    python = given.blender_python or make_environment(given.cache / "bpy")
    activate("auto", given.threads)
    with tempfile.TemporaryDirectory(prefix="importers-") as folder:
        importers = Importers(python, given.threads, Path(folder))
        print(f"Blender {importers.version}, {given.size} x {given.size} pixels")
        try:
            rows = []
            for row in likenesses(given, importers, Path(folder)):
                rows.append(row)
                print(f"{len(rows)}: {row.model}", file=sys.stderr)
        finally:
            importers.close()
    print_table(rows)
    if given.csv:
        write_csv(given.csv, rows)
    return int(any(row.differs for row in rows))


if __name__ == "__main__":
    sys.exit(main())
