"""A trial reading of a binary USD layer, in a process of its own.

OpenUSD trusts the lengths of arrays in .usdc files: one wrong bit makes it ask for gigabytes. Run as a script with a
layer and a number of bytes, this file fails where the layer needs more memory than that.
"""

import subprocess
import sys
from functools import lru_cache

BASE_BYTES, TIMES = 2**30, 64
"""What a layer may take: so much, and so many times its size, since integers are packed well."""
SECONDS = 600


@lru_cache(maxsize=1024)
def trial_problem(identifier: str, size: int, changed: int) -> str:
    """What is wrong with a layer by its path, of `size` bytes, `changed` at that time in nanoseconds; empty if nothing
    is."""
    command = [sys.executable, "-P", __file__, identifier, str(BASE_BYTES + TIMES * size)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS)
    except subprocess.TimeoutExpired:
        return f"expected a USD layer, got one that is not read within {SECONDS} s"
    if not done.returncode:
        return ""
    return done.stdout.strip() or "expected a USD layer, got a damaged one, whose arrays are longer than the file"


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

    import pxr.Sdf  # noqa: F401  its own memory does not count

    resource.setrlimit(resource.RLIMIT_DATA, (int(sys.argv[2]),) * 2)
    try:
        _read_all(sys.argv[1])
    except Exception as error:  # noqa: BLE001  whatever it is, the layer is not to be read
        print(error)
        sys.exit(1)
