"""What is said where a library is not installed, and that the extras bring what they are said to bring."""

import re
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from dataset_builder.errors import UserError
from dataset_builder.extras import LIBRARIES, missing_named

ROOT = Path(__file__).parent.parent
BLOCKED = f"""
import sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {sorted({name for names in LIBRARIES.values() for name in names})}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Blocked())
from dataset_builder.cli.main import main
sys.exit(main(sys.argv[1:]))
"""
"""The command, where no extra is installed."""


def command(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", BLOCKED, *arguments], capture_output=True, text=True, check=False,
                          cwd=ROOT)


@pytest.mark.parametrize(("arguments", "extra"), [
    ("build spec.yaml", "build"), ("plan spec.yaml", "build"), ("inspect folder", "build"), ("doctor", "build"),
    ("train folder", "train"), ("evaluate folder --checkpoint file", "train")])
def test_a_verb_that_lacks_a_library_says_what_to_install(arguments: str, extra: str) -> None:
    done = command(*arguments.split())
    line, = done.stderr.splitlines()
    assert done.returncode == 2 and done.stdout == ""
    assert line.startswith("error: expected the package ") and f'pip install "3df-lighting-builder[{extra}]"' in line


def test_verify_needs_no_extra(small_dataset: Path) -> None:
    done = command("verify", str(small_dataset))
    assert done.returncode == 0 and "10 examples in 6 shards" in done.stdout and not done.stderr
    assert command("--version").returncode == 0


def test_other_missing_modules_are_bugs() -> None:
    for name in ("dataset_builder.none", "nothing_of_ours"):
        with pytest.raises(ModuleNotFoundError), missing_named():
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    with pytest.raises(UserError, match=r"expected the package mitsuba, .*\[build\]"), missing_named():
        raise ModuleNotFoundError("No module named 'mitsuba.python'", name="mitsuba.python")


def test_extras_bring_what_they_are_said_to_bring() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert set(extras) == {*LIBRARIES, "test"}
    homes = packages_distributions()
    for extra in LIBRARIES.keys() - {"gs"}:
        libraries, named = LIBRARIES[extra], {re.split(r"[>=<\[]", requirement)[0] for requirement in extras[extra]}
        brought = {distribution.lower() for library in libraries for distribution in homes[library]}
        assert brought >= {name.lower() for name in named}, extra
        # aiohttp comes by an extra of fsspec, VTK with PyVista
        assert len({*libraries} - {"aiohttp", "vtkmodules"}) == len(named)


@pytest.mark.parametrize("study", ["accuracy", "effects"])
def test_studies_of_renders_do_without_the_trainer(study: str, tmp_path: Path) -> None:
    """PyTorch is not among what `make dataset` installs."""
    verb = ["study", study, "scene_specs/3df-lighting-mini.yaml", "--out", str(tmp_path), "--examples", "1"]
    code = BLOCKED.replace(str(sorted({name for names in LIBRARIES.values() for name in names})), "['torch']").replace(
        "from dataset_builder.cli.main import main", """
from dataset_builder.errors import UserError
from dataset_builder.rendering import backend
def refuse(*_): raise UserError("no backend")
backend.activate = backend.choose = refuse
from dataset_builder.cli.main import main""")
    done = subprocess.run([sys.executable, "-c", code, *verb], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 2 and "no backend" in done.stderr, done.stderr
