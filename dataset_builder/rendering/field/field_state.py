"""How far a fit is, and the file that says so after it was interrupted."""

from __future__ import annotations

import json
import zipfile
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

import numpy as np

from dataset_builder.files import write_atomic


@dataclass(kw_only=True, eq=False)
class FitState:
    """What a fit goes on from."""

    name: str
    """Of the fit: a checkpoint of another name is none."""
    path: Path | None
    """Where it is kept; None for nowhere."""
    stage: int = 0
    """Of the stage that is being run."""
    step: int = 0
    """Steps of this stage that were taken."""
    losses: list[float] = field(default_factory=list)
    """Of the last steps."""
    before: np.ndarray | None = None
    """(S, S, S, 4) values that the stage before ended with."""
    moments: tuple[np.ndarray, ...] | None = None
    """Of this stage after these steps: values of rows, and Adam's first and second moments; None at its begin."""

    @classmethod
    def begun(cls, name: str, path: Path | None) -> FitState:
        """The state that the file at `path` holds, or, where there is none, none that is whole, or that of another fit,
        a new one."""
        try:
            if path is not None:
                with np.load(BytesIO(path.read_bytes()), allow_pickle=False) as members:
                    return cls._read(name, path, {key: members[key] for key in members.files})
        except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile):
            pass
        return cls(name=name, path=path)

    @classmethod
    def _read(cls, name: str, path: Path, members: dict[str, np.ndarray]) -> FitState:
        header = json.loads(bytes(members["header"]))
        if header["name"] != name:
            raise ValueError(header["name"])
        moments = tuple(members[f"moment{k}"] for k in range(3)) if "moment0" in members else None
        return cls(name=name, path=path, stage=header["stage"], step=header["step"], losses=header["losses"],
                   before=members.get("before"), moments=moments)

    def keep(self) -> None:
        """Write the file, whole or not at all. Raises OutputError."""
        if self.path is None:
            return
        header = {"name": self.name, "stage": self.stage, "step": self.step, "losses": self.losses}
        arrays = {"header": np.frombuffer(json.dumps(header).encode(), np.uint8)}
        if self.before is not None:
            arrays["before"] = self.before
        for number, array in enumerate(self.moments or ()):
            arrays[f"moment{number}"] = array
        stream = BytesIO()
        np.savez(stream, **arrays)  # type: ignore[arg-type]
        write_atomic(self.path, stream.getvalue())

    def remove(self) -> None:
        """Remove the file, if there is one."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)
