"""What this machine has: versions, backend, cores, memory, disk, and the command that installs what is missing."""

import importlib.metadata
import platform
import shutil
from dataclasses import dataclass
from pathlib import Path

import psutil

from dataset_builder import __version__
from dataset_builder.errors import UserError
from dataset_builder.files import size_text
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.processes import cores
from dataset_builder.rendering import oidn
from dataset_builder.rendering.backend import INSTALL_LLVM, OPTIX, choose, cuda_available, find_llvm, optix_available

PACKAGES = ("mitsuba", "drjit", "open3d", "OpenEXR", "numpy", "scipy", "pydantic", "ruamel.yaml", "pillow")
GIB = 2**30
MIN_MEMORY, MIN_DISK = 4 * GIB, 2 * GIB


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One line of the report."""

    what: str
    value: str
    mend: str = ""
    """Command or advice where something is missing, else empty."""


def examine(folder: Path) -> list[Finding]:
    """Everything a build needs, in reading order; `folder` is where datasets will be written."""
    return [Finding(what="dataset-builder", value=__version__), Finding(what="Python", value=platform.python_version()),
            *map(_package, PACKAGES), _llvm(), _cuda(), _backend(), _open3d(), _denoiser(), *_machine(folder)]


def _package(name: str) -> Finding:
    try:
        return Finding(what=name, value=importlib.metadata.version(name))
    except importlib.metadata.PackageNotFoundError:
        return Finding(what=name, value="missing", mend="make install")


def _llvm() -> Finding:
    path = find_llvm()
    if path is None:
        mend = "" if cuda_available() and optix_available() else INSTALL_LLVM
        return Finding(what="libLLVM", value="none that works", mend=mend)
    return Finding(what="libLLVM", value=path)


def _cuda() -> Finding:
    if cuda_available() and not optix_available():
        return Finding(what="CUDA", value=f"no libnvoptix.so.1, which tracing rays needs ({OPTIX})")
    return Finding(what="CUDA", value="available" if cuda_available() else "no NVIDIA driver or no device")


def _backend() -> Finding:
    try:
        return Finding(what="backend", value=choose().summary)
    except UserError as error:
        return Finding(what="backend", value="none", mend=str(error))


def _open3d() -> Finding:
    """Open3D imports only where the system has libusb; ask it to build an empty scene."""
    try:
        RayScene([])
    except UserError as error:
        return Finding(what="Open3D loads", value="no", mend=str(error))
    return Finding(what="Open3D loads", value="yes")


def _denoiser() -> Finding:
    """Wanted only by datasets that ship layers denoised, so that nothing needs mending where there is none."""
    try:
        return Finding(what="denoiser", value=oidn.require())
    except UserError as error:
        return Finding(what="denoiser", value=f"none, which datasets without `render.denoise` do not need: {error}")


def _machine(folder: Path) -> list[Finding]:
    memory = psutil.virtual_memory().available
    place = next(path for path in (folder.resolve(), *folder.resolve().parents) if path.exists())
    disk = shutil.disk_usage(place).free
    return [
        Finding(what="cores", value=str(cores())),
        Finding(what="memory free", value=size_text(memory),
                mend="" if memory > MIN_MEMORY else f"expected {size_text(MIN_MEMORY)}: close other programs"),
        Finding(what="disk free", value=f"{size_text(disk)} at {place}",
                mend="" if disk > MIN_DISK else f"expected {size_text(MIN_DISK)}: choose another --out"),
    ]
