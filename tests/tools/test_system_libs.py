"""The script that makes sure of libLLVM and libusb: what it accepts, and that it only speaks where it may not act."""

import os
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "tools" / "system_libs.sh"
USB = "libusb-1.0.so.0"


def run(folder: Path, *, apt_get: str = "no-such-tool", **variables: str) -> subprocess.CompletedProcess[str]:
    kept = {key: value for key, value in os.environ.items() if key != "DRJIT_LIBLLVM_PATH"}
    return subprocess.run(["sh", str(SCRIPT)], capture_output=True, text=True, check=False, timeout=60,
                          env={**kept, "LIBRARY_PATHS": str(folder), "APT_GET": apt_get, **variables})


@pytest.mark.parametrize("llvm", ["libLLVM.so.19.1", "libLLVM-19.so", "libLLVM-17.so.1", "libLLVM.so.20.1"])
def test_good_libraries_need_nothing(tmp_path: Path, llvm: str) -> None:
    for name in (llvm, USB):
        (tmp_path / name).touch()
    result = run(tmp_path)
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")


@pytest.mark.parametrize(("names", "missing"), [
    ([USB], "missing: llvm ("), (["libLLVM-15.so.1", USB], "missing: llvm ("),
    (["libLLVM-14.so", USB], "missing: llvm ("),
    (["libLLVM.so.19.1"], "missing: usb ("), ([], "missing: llvm usb ("), (["libLLVM.so.1.19", USB], "missing: llvm ("),
])
def test_what_is_missing_is_told_with_the_line_to_type(tmp_path: Path, names: list[str], missing: str) -> None:
    for name in names:
        (tmp_path / name).touch()
    result = run(tmp_path)
    assert result.returncode == 1
    assert missing in result.stderr
    assert len([line for line in result.stderr.splitlines() if line.startswith("    ")]) == 1


def test_a_named_library_counts(tmp_path: Path) -> None:
    (tmp_path / USB).touch()
    named = tmp_path / "own.so"
    named.touch()
    assert run(tmp_path, DRJIT_LIBLLVM_PATH=str(named)).returncode == 0
    assert run(tmp_path, DRJIT_LIBLLVM_PATH=str(tmp_path / "none.so")).returncode == 1


@pytest.mark.skipif(os.geteuid() != 0, reason="installs without asking as root only")
def test_root_installs_what_is_missing_after_an_update(tmp_path: Path) -> None:
    libraries, log, tool = tmp_path / "lib", tmp_path / "log", tmp_path / "apt-get"
    libraries.mkdir()
    (libraries / USB).touch()
    tool.write_text(f'#!/bin/sh\necho "$@" >> {log}\ncase $1 in install) touch {libraries}/libLLVM.so.19.1 ;; esac\n')
    tool.chmod(0o755)
    assert run(libraries, apt_get=str(tool)).returncode == 0
    update, install = log.read_text().splitlines()
    assert update.startswith("update")
    assert "libllvm" in install
    assert "libusb" not in install
