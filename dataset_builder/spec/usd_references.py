"""The files that a USD file names, found without opening any outside of its folder."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dataset_builder.digest import open_regular
from dataset_builder.extras import missing_named
from dataset_builder.spec.file_reference import MOST_BYTES, FileReference, is_within
from dataset_builder.spec.problems import shown
from dataset_builder.spec.usd_packages import package_problem
from dataset_builder.spec.usd_trial import trial_problem

if TYPE_CHECKING:
    from pxr import Sdf

USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
TEXT = b"#usda 1."
STARTS = {".usd": (TEXT, b"PXR-USDC"), ".usda": (TEXT,), ".usdc": (b"PXR-USDC",),
          ".usdz": (b"PK\x03\x04",)}
"""What files of each suffix start with; pxr is kept from what is no USD at all."""
MOST_LAYERS = 1000
MOST_SPECS = 500_000
"""Prims that a layer may hold, in all variants."""
TEXTURE, LIGHT_TEXTURE = "inputs:file", "inputs:texture:file"
"""Properties that name images of materials and of lights."""
UDIM = "<UDIM>"
SAID = re.compile(r"' at line \d+ in file [^\n]* : '(.*?)'?\s*$", re.DOTALL)
NEXT = "\n\tError in '"
"""Between the errors that an exception holds; the last one tells the line of the file."""
GRAMMAR = re.compile(r"parse error matching pxr.*? at '", re.DOTALL)
LONGEST = 400
"""Characters of an error, which may hold a path of many prims."""


@dataclass(frozen=True, kw_only=True)
class UsdFiles:
    """What a USD file is composed of."""

    references: tuple[FileReference, ...]
    """Layers and textures."""
    passed_over: tuple[str, ...]
    """Layers in formats that are not read, as they are written."""
    layer_bytes: int
    """Size of all layers, each counted once."""


def usd_references(path: Path, roots: tuple[Path, ...] = ()) -> tuple[FileReference, ...]:
    """Layers that the file is composed of and textures of its shaders; none is opened outside of its folder and
    `roots`. Raises ValueError where one cannot be read, and UserError without usd-core."""
    return usd_files(path, roots).references


def usd_files(path: Path, roots: tuple[Path, ...] = ()) -> UsdFiles:
    """As `usd_references`, with what is passed over."""
    with missing_named():
        from pxr import Ar
    found: dict[tuple[str, str], FileReference] = {}
    passed: list[str] = []
    top = Path(os.path.abspath(path))
    waiting, seen = [str(top)], {str(top)}
    with diagnostics():
        while waiting:
            identifier = waiting.pop(0)
            layer = open_layer(identifier)
            file = Ar.SplitPackageRelativePathOuter(identifier)[0]
            textures = _textures(layer)
            named = [("layer", written) for written in layer.GetCompositionAssetDependencies() if written]
            for key, written in [*named, *textures]:
                target = layer.ComputeAbsolutePath(written)
                outer, inner = Ar.SplitPackageRelativePathOuter(target)
                if not os.path.isabs(outer):
                    outer = os.path.join(os.path.dirname(file), outer)
                if key == LIGHT_TEXTURE and ("://" in written or not os.path.isfile(outer)
                                             or not is_within((top.parent, *roots), outer)):
                    continue  # The light is there without it, and says so
                if "://" in written:
                    raise ValueError(f"{key} of {Path(file).name}: expected a file, got {shown(written)}")
                if key == "layer" and Path(written).suffix.lower() != ".mtlx":
                    _require_usd(inner or outer, file, written)
                    if target not in seen and is_within((top.parent, *roots), outer) and os.path.isfile(outer):
                        seen.add(target)
                        waiting.append(target)
                elif key == "layer":
                    passed.append(written)
                    continue
                if os.path.abspath(outer) != str(top) and UDIM not in written:
                    name = os.path.relpath(outer, top.parent)
                    found.setdefault((file, name), FileReference(
                        by=path if file == str(top) else Path(file), key=key, written=written, name=name,
                        image=key == TEXTURE and not inner))
            if len(seen) > MOST_LAYERS:
                raise ValueError(f"expected at most {MOST_LAYERS} layers, got more")
    sizes = [os.path.getsize(file) for file in {Ar.SplitPackageRelativePathOuter(layer)[0] for layer in seen}]
    return UsdFiles(references=tuple(found.values()), passed_over=tuple(dict.fromkeys(passed)), layer_bytes=sum(sizes))


def open_layer(identifier: str) -> "Sdf.Layer":
    """A layer by its path, which may be within a package. Raises ValueError where it cannot be read."""
    from pxr import Ar, Sdf, Tf

    outer, inner = Ar.SplitPackageRelativePathOuter(identifier)
    with open_regular(Path(outer), most=MOST_BYTES) as stream:
        start, status = stream.read(8), os.fstat(stream.fileno())
    if not start.startswith(STARTS[Path(outer).suffix.lower()]):
        raise ValueError(f"expected it to start with {STARTS[Path(outer).suffix.lower()][0].decode('latin-1')}, got "
                         f"{shown(start.decode('latin-1'))}")
    if Path(outer).suffix.lower() == ".usdz" and (problem := package_problem(Path(outer))):
        raise ValueError(problem)
    if not start.startswith(TEXT) and (problem := trial_problem(identifier, status.st_size, status.st_mtime_ns)):
        raise ValueError(said(problem).replace(identifier, Path(identifier).name))
    try:
        layer = Sdf.Layer.FindOrOpen(identifier)
    except Tf.ErrorException as error:
        raise ValueError(said(str(error)).replace(identifier, Path(identifier).name)) from error
    if layer is None:
        raise ValueError(f"expected a USD layer, got {inner or Path(outer).name}, which is damaged or not there")
    return layer


def said(text: str) -> str:
    """What an exception of pxr says, without where in its code it was raised."""
    match = SAID.search(text.rpartition(NEXT)[2])
    words = GRAMMAR.sub("cannot be parsed at '", (match[1] if match else text).strip())
    return words if len(words) <= LONGEST else f"{words[:LONGEST // 2]} ... {words[-LONGEST // 2:]}"


@contextmanager
def diagnostics() -> Iterator[None]:
    """Keep pxr's warnings off the terminal."""
    from pxr import UsdUtils

    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        delegate.TakeUncoalescedDiagnostics()
        delegate.TakeCoalescedDiagnostics()


def _textures(layer: "Sdf.Layer") -> list[tuple[str, str]]:
    """What the shaders and lights of a layer read: the property, and what is written there, each once."""
    from pxr import Sdf

    found: list[tuple[str, str]] = []
    prims = 0

    def visit(where: "Sdf.Path") -> None:
        nonlocal prims
        prims += where.IsPrimPath()
        if prims > MOST_SPECS:
            raise ValueError(f"expected at most {MOST_SPECS:,} prims in a layer, got more")
        if where.IsPropertyPath() and where.name in (TEXTURE, LIGHT_TEXTURE):
            node = layer.GetAttributeAtPath(where.GetPrimPath().AppendProperty("info:id"))
            if where.name == TEXTURE and node and node.default not in (None, "UsdUVTexture"):
                return
            times = layer.ListTimeSamplesForPath(where)
            values = [layer.GetAttributeAtPath(where).default, *(layer.QueryTimeSample(where, time) for time in times)]
            found.extend((where.name, value.path) for value in values
                         if isinstance(value, Sdf.AssetPath) and value.path)

    layer.Traverse(Sdf.Path.absoluteRootPath, visit)
    return [*dict.fromkeys(found)]


def _require_usd(target: str, file: str, written: str) -> None:
    if Path(target).suffix.lower() not in USD_SUFFIXES:
        raise ValueError(f"{Path(file).name}: expected layers that end in one of {' '.join(USD_SUFFIXES)}, got "
                         f"{shown(written)}")
