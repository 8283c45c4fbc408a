"""The doctor says what is there, what is missing, and the command that mends it."""

import importlib.metadata
import sys
from collections import namedtuple
from pathlib import Path

import pytest

from dataset_builder.cli.main import main
from dataset_builder.errors import UserError
from dataset_builder.rendering import backend
from dataset_builder.report import doctor
from dataset_builder.report.doctor import GIB, Finding, examine


def found(folder: Path) -> dict[str, Finding]:
    return {finding.what: finding for finding in examine(folder)}


@pytest.fixture
def no_llvm(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine with neither CUDA nor a libLLVM that works."""
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    monkeypatch.setattr(backend.glob, "glob", lambda pattern: [])
    for module in (backend, doctor):
        monkeypatch.setattr(module, "cuda_available", lambda: False)


def test_a_machine_that_has_everything(tmp_path: Path) -> None:
    findings = found(tmp_path / "not" / "yet")
    assert findings["mitsuba"].value == importlib.metadata.version("mitsuba")
    assert findings["backend"].value.startswith(("llvm_ad_rgb with ", "cuda_ad_rgb"))
    assert findings["Open3D loads"].value == "yes"
    assert findings["disk free"].value.endswith(f"GiB at {tmp_path}") and int(findings["cores"].value) >= 1


@pytest.mark.usefixtures("no_llvm")
def test_without_llvm(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    findings = found(tmp_path)
    assert findings["libLLVM"] == Finding(what="libLLVM", value="none that works", mend=backend.INSTALL_LLVM)
    assert findings["backend"].value == "none" and backend.INSTALL_LLVM in findings["backend"].mend
    monkeypatch.setenv("COLUMNS", "200")
    assert main(["doctor", "--out", str(tmp_path)]) == 1
    assert backend.INSTALL_LLVM in capsys.readouterr().out


@pytest.mark.usefixtures("no_llvm")
def test_cuda_needs_no_llvm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (backend, doctor):
        monkeypatch.setattr(module, "cuda_available", lambda: True)
        monkeypatch.setattr(module, "optix_available", lambda: True)
    findings = found(tmp_path)
    assert findings["libLLVM"].mend == "" and findings["backend"].value == "cuda_ad_rgb on the NVIDIA GPU"


def test_a_package_that_is_missing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(doctor, "PACKAGES", ("numpy", "no-such-package"))
    findings = found(tmp_path)
    assert findings["numpy"].mend == "" and findings["no-such-package"].mend == "make install"


def test_open3d_that_does_not_load(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def refuse(parts: object) -> None:
        raise UserError("libusb-1.0.so.0 is missing; apt-get install -y libusb-1.0-0")

    monkeypatch.setattr(doctor, "RayScene", refuse)
    assert "libusb-1.0-0" in found(tmp_path)["Open3D loads"].mend


def test_too_little_memory_and_disk(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    memory, disk = namedtuple("memory", "available"), namedtuple("disk", "free")
    monkeypatch.setattr(doctor.psutil, "virtual_memory", lambda: memory(available=GIB))
    monkeypatch.setattr(doctor.shutil, "disk_usage", lambda place: disk(free=GIB / 2))
    findings = found(tmp_path)
    assert findings["memory free"] == Finding(what="memory free", value="1.0 GiB",
                                              mend="expected 4.0 GiB: close other programs")
    assert findings["disk free"].mend == "expected 2.0 GiB: choose another --out"


def test_a_denoiser_is_told_and_not_demanded(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Only datasets that ship layers denoised need one."""
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    finding = found(tmp_path)["denoiser"]
    assert "none" in finding.value and "pip install" in finding.value and finding.mend == ""
