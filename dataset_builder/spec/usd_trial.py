"""Trial readings of USD layers and stages, in a process of their own.

OpenUSD trusts the lengths of arrays in .usdc files: one wrong bit makes it ask for gigabytes. And a few lines of prims
that reference each other make a stage without end. Run as a script with a path, a number of bytes, `layer` or `stage`,
and choices of variants as JSON, this file fails where reading needs more memory than that.
"""

import difflib
import json
import os
import subprocess
import sys
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from pxr import Usd

Choices = tuple[tuple[str, str, str], ...]
"""Prim path, variant set and variant, of each variant that is chosen."""
NAMES = 100_000
"""Prims among which the nearest names are looked for."""

BASE_BYTES, CORE_BYTES, TIMES = 2**28, 2**25, 64
"""What reading may take: so much, so much for each core, and so many times the size, since integers are packed well."""
SECONDS = 120


@lru_cache(maxsize=1024)
def trial_problem(identifier: str, size: int, changed: int, kind: Literal["layer", "stage"] = "layer",
                  choices: Choices = ()) -> str:
    """What is wrong with a layer by its path, or with the stage that it is the root of; empty if nothing is.

    size: bytes of all that is read. changed: when, in nanoseconds; another time is another trial. choices: variants of
    the stage.
    """
    most = BASE_BYTES + CORE_BYTES * (os.cpu_count() or 1) + TIMES * size
    command = [sys.executable, "-P", __file__, identifier, str(most), kind, json.dumps(choices)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS)
    except subprocess.TimeoutExpired:
        return f"expected a USD layer, got a {kind} that is not read within {SECONDS} s"
    if not done.returncode:
        return ""
    return done.stdout.strip() or f"expected a USD {kind} that needs less than {most:,} bytes of memory"


def open_stage(path: str, choices: Choices) -> "Usd.Stage":
    """A stage with all payloads and the chosen variants, which may bring each other into being. Raises ValueError for a
    choice of what is not there, with the nearest names."""
    from pxr import Usd

    stage = Usd.Stage.Open(path, Usd.Stage.LoadAll)
    waiting = list(choices)
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        while waiting:
            ready = [choice for choice in waiting if not _choice_problem(stage, *choice)]
            if not ready:
                raise ValueError(_choice_problem(stage, *waiting[0]))
            for choice in ready:
                prim, name, variant = choice
                stage.GetPrimAtPath(prim).GetVariantSet(name).SetVariantSelection(variant)
                waiting.remove(choice)
    return stage


def _choice_problem(stage: "Usd.Stage", path: str, name: str, variant: str) -> str:
    """What is wrong with the choice of a variant, in a line; empty if nothing is."""
    from pxr import Sdf

    if not Sdf.Path.IsValidPathString(path) or not path.startswith("/"):
        return f"variants: expected the path of a prim, such as /World/Chair, got {path!r}"
    if not (prim := stage.GetPrimAtPath(path)) or prim.IsPseudoRoot():
        paths = [str(other.GetPath()) for other, _ in zip(stage.TraverseAll(), range(NAMES), strict=False)]
        return f"variants: expected a prim of the stage, got {path}{_nearest(path, paths)}"
    if prim.IsInstanceProxy() or prim.IsInPrototype():
        return f"variants: expected a prim that may differ, got {path}, which instances share; choose on the instance"
    if name not in (names := prim.GetVariantSets().GetNames()):
        return f"variants: {path}: expected a variant set, got {name}{_nearest(name, names)}"
    if variant not in (names := prim.GetVariantSet(name).GetVariantNames()):
        return f"variants: {path}: {name}: expected a variant, got {variant}{_nearest(variant, names)}"
    return ""


def _nearest(name: str, names: list[str]) -> str:
    near = difflib.get_close_matches(name, names, n=3, cutoff=0.4) or names[:3]
    return f" (nearest: {', '.join(near)})" if near else " (there is none)"


def _read_all(identifier: str) -> None:
    """Read every value of a layer."""
    from pxr import Sdf

    layer = Sdf.Layer.FindOrOpen(identifier)

    def visit(where: "Sdf.Path") -> None:
        attribute = layer.GetAttributeAtPath(where) if where.IsPropertyPath() else None
        if attribute is not None:
            _ = attribute.default
            for time in layer.ListTimeSamplesForPath(where):
                layer.QueryTimeSample(where, time)

    if layer is not None:
        layer.Traverse(Sdf.Path.absoluteRootPath, visit)


if __name__ == "__main__":
    import resource

    resource.setrlimit(resource.RLIMIT_DATA, (int(sys.argv[2]),) * 2)
    try:
        if sys.argv[3] == "layer":
            _read_all(sys.argv[1])
        else:
            open_stage(sys.argv[1], json.loads(sys.argv[4]))
    except Exception as error:  # noqa: BLE001  whatever it is, the layer is not to be read
        print(error)
        sys.exit(1)
