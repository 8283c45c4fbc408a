"""From what people write to a place: a folder of this machine, or one at an address."""

import importlib
from pathlib import Path

from dataset_builder.extras import missing_named
from dataset_builder.remote.address import DRIVERS, is_address, local_path, refused, require_sound
from dataset_builder.remote.patience import PATIENCE, Patience
from dataset_builder.remote.place import FolderPlace, Place


def place_of(address: str | Path, *, patience: Patience | None = None) -> Place:
    """The place at a path or an address: file, http(s), s3, gs, or hf://datasets/USER/NAME[@REVISION].

    Nothing is fetched yet. Raises UserError where it is no such address, and where the package that reads it is not
    installed.
    """
    if not is_address(address):
        return FolderPlace(Path(address))
    address = str(address)
    scheme = address.partition("://")[0].lower()
    if scheme == "file":
        return FolderPlace(local_path(address))
    if scheme not in DRIVERS:
        raise refused(address, f"expected an address that begins with file, {', '.join(DRIVERS)}, got {scheme}")
    require_driver(address, scheme)
    from dataset_builder.remote.remote_place import RemotePlace

    return RemotePlace(address, patience or PATIENCE)


def require_driver(address: str, scheme: str) -> None:
    """Raise UserError where an address has not the form that its scheme wants, or the package for it is not installed.
    """
    require_sound(address, scheme)
    with missing_named():
        for library in DRIVERS[scheme]:
            importlib.import_module(library)
