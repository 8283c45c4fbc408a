"""The only module that imports Open3D, and late: it takes seconds and needs a system library that its wheel lacks."""

import importlib
from types import ModuleType

from dataset_builder.errors import UserError

LIBRARY = "libusb-1.0"
PACKAGE = "libusb-1.0-0"


def open3d() -> ModuleType:
    """The module `open3d`. Raises UserError with the command that mends it where it or libusb-1.0 is missing."""
    try:
        return importlib.import_module("open3d")
    except (ImportError, OSError) as error:
        raise missing(error) from error


def missing(error: Exception) -> UserError:
    """What to do about a failed import of Open3D."""
    if LIBRARY in str(error):
        return UserError(f"Open3D: expected the system library {LIBRARY}, got: {error}; on Debian or Ubuntu: "
                         f"apt-get install {PACKAGE}")
    return UserError(f"Open3D: expected it to import, got: {error}; install the locked dependencies again")
