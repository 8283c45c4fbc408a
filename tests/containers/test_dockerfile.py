"""The image: no complaint of hadolint, and the same installation as `make dataset`."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCKERFILE = ROOT / "containers" / "Dockerfile"


def hadolint() -> str | None:
    beside = Path(sys.executable).parent / "hadolint"
    return str(beside) if beside.is_file() else shutil.which("hadolint")


@pytest.mark.skipif(hadolint() is None, reason="hadolint is not installed")
def test_hadolint_has_no_complaint(tmp_path: Path) -> None:
    tool = hadolint()
    assert tool is not None
    told = subprocess.run([tool, str(DOCKERFILE)], capture_output=True, text=True, check=False)
    assert (told.returncode, told.stdout) == (0, "")
    (tmp_path / "Dockerfile").write_text("FROM debian\nRUN cd /tmp && sudo ls\n")
    assert subprocess.run([tool, str(tmp_path / "Dockerfile")], capture_output=True, check=False).returncode == 1


def made(target: str) -> list[str]:
    """The commands of a target from nothing."""
    # Not as a part of the make that runs the tests
    plain = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}
    told = subprocess.run(["make", "--dry-run", "--always-make", target], cwd=ROOT, capture_output=True, text=True,
                          check=True, env=plain)
    return told.stdout.splitlines()


def test_the_image_installs_as_make_does() -> None:
    """`make install` is what `make dataset` begins with; what comes besides comes by the same script and lock file."""
    install = made("install")
    assert made("dataset")[:len(install)] == install and any("tools/make_venv.sh" in line for line in install)
    lines = re.sub(r"\\\n\s*", "", re.sub(r"^#.*\n", "", DOCKERFILE.read_text(), flags=re.MULTILINE)).splitlines()
    steps = [step.strip() for line in lines if line.startswith("RUN ") for step in line[4:].split("&&")]
    assert [step for step in steps if step.startswith("make ")] == ["make install"]
    assert not [step for step in steps if re.search(r"\bpip\b", step)]
    assert [step for step in steps if "make_venv" in step] == ['sh tools/make_venv.sh .venv "${EXTRAS}"']
    script = (ROOT / "tools" / "make_venv.sh").read_text()
    assert "--constraint constraints.txt" in script
    extras = next(line for line in lines if line.startswith("ARG EXTRAS=")).removeprefix("ARG EXTRAS=").split(",")
    offered = (ROOT / "pyproject.toml").read_text().partition("[project.optional-dependencies]")[2]
    assert all(re.search(rf"^{extra} = \[", offered, re.MULTILINE) for extra in extras)


def test_the_image_is_nobodys_own() -> None:
    """It runs as a user that is not root, on either base, and copies what git has, without what is made."""
    text = DOCKERFILE.read_text()
    last = re.findall(r"^USER (.+)$", text, re.MULTILINE)[-1]
    assert re.fullmatch(r"[1-9]\d*:[1-9]\d*", last)
    assert re.search(r"^ARG BASE=\S+:\S+$", text, re.MULTILINE) and "FROM ${BASE}" in text
    ignored = (DOCKERFILE.parent / "Dockerfile.dockerignore").read_text().split()
    assert {".git", ".venv", "datasets"} <= set(ignored)
    assert all(not re.match(name, "dataset_builder") for name in ignored if "*" not in name)
