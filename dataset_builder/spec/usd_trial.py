"""Trial readings of USD layers and stages, in a process of their own.

OpenUSD trusts the lengths of arrays in .usdc files: one wrong bit makes it ask for gigabytes. And a few lines of prims
that reference each other make a stage without end. Run as a script with a path, a number of bytes, and `layer` or
`stage`, this file fails where reading needs more memory than that.
"""

import os
import subprocess
import sys
from functools import lru_cache
from typing import Literal

BASE_BYTES, CORE_BYTES, TIMES = 2**28, 2**25, 64
"""What reading may take: so much, so much for each core, and so many times the size, since integers are packed well."""
SECONDS = 120


@lru_cache(maxsize=1024)
def trial_problem(identifier: str, size: int, changed: int, kind: Literal["layer", "stage"] = "layer") -> str:
    """What is wrong with a layer by its path, or with the stage that it is the root of; empty if nothing is.

    size: bytes of all that is read. changed: when, in nanoseconds; another time is another trial.
    """
    most = BASE_BYTES + CORE_BYTES * (os.cpu_count() or 1) + TIMES * size
    command = [sys.executable, "-P", __file__, identifier, str(most), kind]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS)
    except subprocess.TimeoutExpired:
        return f"expected a USD layer, got a {kind} that is not read within {SECONDS} s"
    if not done.returncode:
        return ""
    return done.stdout.strip() or f"expected a USD {kind} that needs less than {most:,} bytes of memory"


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

    from pxr import Usd

    resource.setrlimit(resource.RLIMIT_DATA, (int(sys.argv[2]),) * 2)
    try:
        if sys.argv[3] == "layer":
            _read_all(sys.argv[1])
        else:
            Usd.Stage.Open(sys.argv[1], Usd.Stage.LoadAll)
    except Exception as error:  # noqa: BLE001  whatever it is, the layer is not to be read
        print(error)
        sys.exit(1)
