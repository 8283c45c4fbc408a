"""A USD stage, opened: composed as its file and the choice of variants say, within what reading may take."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.assets.file_model import counted, refuse
from dataset_builder.assets.readers.usd_inventory import stage_settings
from dataset_builder.extras import missing_named
from dataset_builder.spec.usd_references import diagnostics, said, usd_files
from dataset_builder.spec.usd_trial import Choices, open_stage, trial_problem

if TYPE_CHECKING:
    from pxr import Usd


@dataclass(frozen=True, kw_only=True, eq=False)
class OpenStage:
    """A stage and what it says of itself."""

    path: Path
    folders: tuple[Path, ...]
    """Where its files may lie."""
    stage: "Usd.Stage"
    metres: np.ndarray
    """(4, 4) from the stage to metres with y up."""
    decided: tuple[str, ...]
    """What was chosen where it leaves a choice, and what of it could not be composed, in words."""


@contextmanager
def stage_of(path: Path, roots: tuple[Path, ...] = (), choices: Choices = ()) -> Iterator[OpenStage]:
    """The stage of a file, whose other files lie in its folder or in `roots`. Raises UserError where it cannot be read,
    for whatever reason, for variants that are not there, for references in a circle, and without usd-core."""
    with missing_named():
        from pxr import Tf
    try:
        files = usd_files(path, roots)
        status = path.stat()
        if problem := trial_problem(str(path), files.layer_bytes, status.st_mtime_ns, "stage", choices):
            raise ValueError(said(problem))
        with diagnostics():
            stage = open_stage(str(path), choices)
            metres, decided = stage_settings(path, stage)
            yield OpenStage(path=path, folders=(path.parent, *roots), stage=stage, metres=metres, decided=(
                *(f"reference to {name}" for name in files.passed_over), *decided, *_composition(path, stage)))
    except Tf.ErrorException as error:
        refuse(path, f"expected a readable {path.suffix} file, got: {said(str(error))}")
    except (OSError, RuntimeError, TypeError, ValueError, OverflowError) as error:
        refuse(path, f"expected a readable {path.suffix} file, got: {error}")


@contextmanager
def naming(path: Path, prim: str) -> Iterator[None]:
    """Name the prim in what goes wrong with its values meanwhile. Raises UserError."""
    try:
        yield
    except (OverflowError, RuntimeError, TypeError, ValueError) as error:
        refuse(path, f"expected values of the prim's schema, got: {said(str(error))}", at=prim)


def _composition(path: Path, stage: "Usd.Stage") -> list[str]:
    """What could not be composed, in words. Raises UserError for circles."""
    from pxr import Pcp

    found = []
    for error in stage.GetCompositionErrors():
        text = " ".join(str(error).replace(str(path.parent), "").split())
        if isinstance(error, (Pcp.ErrorArcCycle, Pcp.ErrorSublayerCycle)):
            refuse(path, "expected references that come to an end, got a circle", "see what the prim refers to",
                   at=_site(error))
        if not isinstance(error, Pcp.ErrorInvalidAssetPath):
            found.append(f"not composed: {text}")
    more = len(found) - 20
    return [*found[:20], *([f"{counted(more, 'more arc')} that could not be composed"] if more > 0 else [])]


def _site(error: object) -> str:
    """Prim that an error of composition is about."""
    root = getattr(error, "rootSite", None)
    return str(getattr(root, "path", "") or "")
