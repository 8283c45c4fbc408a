"""The script that makes sure of system libraries: what it accepts, and that it only speaks where it may not act."""

import importlib.util
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "tools" / "system_libs.sh"
USB = "libusb-1.0.so.0"
DISPLAY = ("libGL.so.1", "libEGL.so.1", "libX11.so.6", "libidn2.so.0")


def run(folder: Path, *, apt_get: str = "no-such-tool", **variables: str) -> subprocess.CompletedProcess[str]:
    kept = {key: value for key, value in os.environ.items() if key != "DRJIT_LIBLLVM_PATH"}
    return subprocess.run(["sh", str(SCRIPT)], capture_output=True, text=True, check=False, timeout=60,
                          env={**kept, "LIBRARY_PATHS": str(folder), "APT_GET": apt_get, **variables})


@pytest.mark.parametrize("llvm", ["libLLVM.so.19.1", "libLLVM-19.so", "libLLVM-17.so.1", "libLLVM.so.20.1"])
def test_good_libraries_need_nothing(tmp_path: Path, llvm: str) -> None:
    for name in (llvm, USB, *DISPLAY):
        (tmp_path / name).touch()
    result = run(tmp_path)
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")


@pytest.mark.parametrize(("names", "missing"), [
    ([USB], "missing: llvm ("), (["libLLVM-15.so.1", USB], "missing: llvm ("),
    (["libLLVM-14.so", USB], "missing: llvm ("),
    (["libLLVM.so.19.1"], "missing: usb ("), ([], "missing: llvm usb ("), (["libLLVM.so.1.19", USB], "missing: llvm ("),
])
def test_what_is_missing_is_told_with_the_line_to_type(tmp_path: Path, names: list[str], missing: str) -> None:
    for name in [*names, *DISPLAY]:
        (tmp_path / name).touch()
    result = run(tmp_path)
    assert result.returncode == 1
    assert missing in result.stderr
    assert len([line for line in result.stderr.splitlines() if line.startswith("    ")]) == 1


@pytest.mark.parametrize("absent", DISPLAY)
def test_what_open3d_is_linked_with_is_missed(tmp_path: Path, absent: str) -> None:
    for name in {"libLLVM.so.19.1", USB, *DISPLAY} - {absent}:
        (tmp_path / name).touch()
    result = run(tmp_path)
    assert result.returncode == 1 and "missing: display (" in result.stderr


def test_open3d_is_linked_with_nothing_else_that_a_small_system_lacks() -> None:
    """What the loader looks for beside what Python and the C++ library need themselves."""
    parts = importlib.util.find_spec("open3d")
    assert parts is not None and parts.origin is not None
    if shutil.which("readelf") is None:
        pytest.skip("readelf is not installed")
    told = subprocess.run(["readelf", "-d", *Path(parts.origin).parent.glob("libOpen3D.so*")], capture_output=True,
                          text=True, check=True)
    needed = set(re.findall(r"\(NEEDED\).*\[(.+)\]", told.stdout))
    assert needed - {"libtbb.so.12", "libstdc++.so.6", "libgcc_s.so.1", "libm.so.6", "libc.so.6", "libudev.so.1",
                     "ld-linux-x86-64.so.2"} == {USB, *DISPLAY}, "libudev comes with libusb, libtbb with the wheel"


def test_a_named_library_counts(tmp_path: Path) -> None:
    for name in (USB, *DISPLAY):
        (tmp_path / name).touch()
    named = tmp_path / "own.so"
    named.touch()
    assert run(tmp_path, DRJIT_LIBLLVM_PATH=str(named)).returncode == 0
    assert run(tmp_path, DRJIT_LIBLLVM_PATH=str(tmp_path / "none.so")).returncode == 1


@pytest.mark.skipif(os.geteuid() != 0, reason="installs without asking as root only")
def test_root_installs_what_is_missing_after_an_update(tmp_path: Path) -> None:
    libraries, log, tool = tmp_path / "lib", tmp_path / "log", tmp_path / "apt-get"
    libraries.mkdir()
    for name in (USB, *DISPLAY):
        (libraries / name).touch()
    tool.write_text(f'#!/bin/sh\necho "$@" >> {log}\ncase $1 in install) touch {libraries}/libLLVM.so.19.1 ;; esac\n')
    tool.chmod(0o755)
    assert run(libraries, apt_get=str(tool)).returncode == 0
    update, install = log.read_text().splitlines()
    assert update.startswith("update")
    assert "libllvm" in install
    assert "libusb" not in install
