"""USDZ packages: what their list of files may say. https://openusd.org/release/spec_usdz.html"""

import zipfile
from pathlib import Path, PurePosixPath

from dataset_builder.digest import open_regular
from dataset_builder.spec.file_reference import MOST_BYTES
from dataset_builder.spec.problems import shown

MOST_MEMBERS = 10_000


def package_problem(path: Path) -> str:
    """What is wrong with the list of files in a package, in a line; empty if nothing is.

    Files lie in a package as they are, so that all together are no larger than it; they are named from its top. Raises
    OSError where it cannot be read.
    """
    with open_regular(path, most=MOST_BYTES) as stream:
        try:
            with zipfile.ZipFile(stream) as package:
                members = package.infolist()
        except (zipfile.BadZipFile, ValueError, NotImplementedError, EOFError) as error:
            return f"expected a package, got {path.name}, which is damaged: {error}"
    if len(members) > MOST_MEMBERS:
        return f"expected at most {MOST_MEMBERS} files in {path.name}, got {len(members)}"
    for member in members:
        name = PurePosixPath(member.filename.replace("\\", "/"))
        if name.is_absolute() or ".." in name.parts or ":" in name.parts[0:1]:
            return f"expected files within {path.name}, got one called {shown(member.filename)}"
        if member.compress_type != zipfile.ZIP_STORED or member.flag_bits & 1:
            return f"expected a package without compression or encryption, got {shown(member.filename)} with it"
    if sum(member.file_size for member in members) > path.stat().st_size:
        return f"expected files that are no larger than {path.name} itself, got more"
    return ""
