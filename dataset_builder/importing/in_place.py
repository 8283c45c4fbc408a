"""Files of an import that come into place together, and take nobody's."""

from collections.abc import Sequence
from pathlib import Path

from dataset_builder.errors import Problem, UserError


def refuse_existing(out: Path, names: Sequence[str]) -> None:
    """Raises UserError that tells every file that lies there already."""
    if there := [name for name in names if (out / name).exists() or (out / name).is_symlink()]:
        raise UserError(Problem(where=str(out / name), path="", hint="name another folder with --out, or remove it",
                                rule="expected no such file yet, got one; nothing is overwritten") for name in there)


def move(names: Sequence[str], staging: Path, out: Path) -> None:
    """Move files, or folders that are new, from `staging` into `out`, all or none. Raises OSError."""
    moved = list[Path]()
    try:
        for name in names:
            (out / name).parent.mkdir(parents=True, exist_ok=True)
            (staging / name).rename(out / name)
            moved.append(out / name)
    except OSError:
        for path in moved:
            path.rename(staging / path.relative_to(out))
        raise
