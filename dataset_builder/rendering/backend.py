"""Choose the Dr.Jit backend: CUDA where it runs, else LLVM with a library that works.

Dr.Jit 1.5 loads the first libLLVM it finds as soon as it is imported, and aborts the process on some old ones. So
`rendering/__init__.py` names a good one before anything here imports Dr.Jit.
"""

import ctypes
import glob
import importlib.metadata
import os
import re
from dataclasses import dataclass
from functools import cache

from dataset_builder.errors import UserError
from dataset_builder.processes import cores

GOOD_LLVM = range(17, 22)
"""Major versions that Dr.Jit 1.5 runs with; 14 is refused by it, 15 and 16 abort the process."""

PREFERRED_LLVM = 19
PATTERNS = (
    "/usr/lib/*-linux-gnu/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/lib/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
    "/usr/local/opt/llvm*/lib/libLLVM*.dylib",
)
LANES = {"avx512vl": 16, "avx": 8}
"""Single precision numbers of a vector by what the processor can, the widest first, as Dr.Jit chooses them."""

INSTALL_LLVM = "apt-get install -y libllvm19"
OPTIX = "containers get it with NVIDIA_DRIVER_CAPABILITIES=compute,utility,graphics"
"""Where OptiX comes from."""


@dataclass(frozen=True, kw_only=True)
class Backend:
    """What renders."""

    variant: str
    """Mitsuba's name for it."""
    llvm: str
    """The libLLVM in use; empty on CUDA."""
    summary: str
    """One line that says so."""


def llvm_version(path: str) -> int | None:
    """Major version in a libLLVM's file name; None where it has none.

    >>> llvm_version("/usr/lib/libLLVM-19.so"), llvm_version("libLLVM.so.20.1"), llvm_version("libLLVM.so")
    (19, 20, None)
    """
    match = re.search(r"libLLVM(?:-|\.so\.)(\d+)", path)
    return int(match.group(1)) if match else None


def find_llvm() -> str | None:
    """Path of the best libLLVM: the one in DRJIT_LIBLLVM_PATH if set, else the good version nearest the preferred."""
    if chosen := os.environ.get("DRJIT_LIBLLVM_PATH"):
        return chosen
    found = sorted({path for pattern in PATTERNS for path in glob.glob(pattern)})
    good = {path: version for path in found if (version := llvm_version(path)) is not None and version in GOOD_LLVM}
    return min(good, key=lambda path: (abs(good[path] - PREFERRED_LLVM), path), default=None)


def cuda_available() -> bool:
    """True where the NVIDIA driver library loads and reports at least one device."""
    try:
        driver = ctypes.CDLL("libcuda.so.1")
    except OSError:
        return False
    count = ctypes.c_int(0)
    return driver.cuInit(0) == 0 and driver.cuDeviceGetCount(ctypes.byref(count)) == 0 and count.value > 0


def optix_available() -> bool:
    """Whether NVIDIA's ray tracing library loads, which comes with the driver; containers have it only where they ask
    for it. Dr.Jit looks in the same places."""
    try:
        ctypes.CDLL(os.environ.get("DRJIT_LIBOPTIX_PATH", "libnvoptix.so.1"))
    except OSError:
        return False
    return True


def gpu_usable() -> bool:
    """Whether a GPU is here, and all that rendering on it needs."""
    return cuda_available() and optix_available()


def on_gpu(wanted: str) -> bool:
    """Whether `wanted` means a GPU, be there one here or not; `auto` does where one can be used."""
    return wanted == "cuda" or (wanted == "auto" and gpu_usable())


def default_workers(wanted: str) -> int:
    """Processes of a build that is told no number: one on a GPU, else one per core."""
    return 1 if on_gpu(wanted) else cores()


def choose(wanted: str = "auto") -> Backend:
    """Backend for `wanted` in auto | cuda | llvm. Raises UserError where it cannot run, with the command that mends
    it."""
    if wanted not in ("auto", "cuda", "llvm"):
        raise UserError(f"backend: expected auto, cuda or llvm, got {wanted!r}")
    if wanted != "llvm" and gpu_usable():
        return Backend(variant="cuda_ad_rgb", llvm="", summary="cuda_ad_rgb on the NVIDIA GPU")
    if wanted == "cuda" and cuda_available():
        raise UserError("backend: expected OptiX beside the NVIDIA driver for cuda, found no libnvoptix.so.1; "
                        f"{OPTIX}, or use --backend llvm")
    if wanted == "cuda":
        raise UserError("backend: expected an NVIDIA GPU for cuda, but its driver reports none; use --backend llvm")
    llvm = find_llvm()
    if llvm is None:
        raise UserError(f"backend: no libLLVM of version {GOOD_LLVM[0]} to {GOOD_LLVM[-1]} found; install one "
                        f"(Debian, Ubuntu: {INSTALL_LLVM}) or set DRJIT_LIBLLVM_PATH to its file")
    if llvm == os.environ.get("DRJIT_LIBLLVM_PATH") and os.sep in llvm and not os.path.isfile(llvm):
        raise UserError(f"DRJIT_LIBLLVM_PATH: expected a libLLVM, found no file {llvm}; correct it or unset it")
    return Backend(variant="llvm_ad_rgb", llvm=llvm, summary=f"llvm_ad_rgb with {llvm}")


def renderer_versions(wanted: str = "auto") -> dict[str, str]:
    """Versions and variant that pixels depend on; raises UserError as `choose` does. Mitsuba is not imported."""
    packages = {name: importlib.metadata.version(name) for name in ("mitsuba", "drjit")}
    backend = choose(wanted)
    return {**packages, "variant": backend.variant, "llvm": str(llvm_version(backend.llvm) or ""),
            "processor": processor(backend.llvm) if backend.llvm else ""}


@cache
def processor(llvm: str) -> str:
    """The kind of processor that kernels are compiled for, as LLVM calls it, with the lanes of its vector unit; empty
    where this libLLVM does not say.

    Dr.Jit compiles for exactly this kind. Its approximate reciprocals, and the order in which lanes are added, differ
    between kinds, and so do bytes.
    """
    try:
        library = ctypes.CDLL(llvm)
        name, features = (_text_of(library, f"LLVMGetHostCPU{what}") for what in ("Name", "Features"))
    except (OSError, AttributeError):
        return ""
    lanes = next((count for feature, count in LANES.items() if f"+{feature}" in features.split(",")), 4)
    return f"{name} x{lanes}"


def _text_of(library: ctypes.CDLL, function: str) -> str:
    call = getattr(library, function)
    call.restype = ctypes.c_void_p
    found = call()
    try:
        return ctypes.string_at(found).decode()
    finally:
        library.LLVMDisposeMessage(ctypes.c_void_p(found))


def name_llvm() -> None:
    """Set DRJIT_LIBLLVM_PATH to the best libLLVM there is, unless it is set; for Dr.Jit, which is not imported yet."""
    if llvm := find_llvm():
        os.environ["DRJIT_LIBLLVM_PATH"] = llvm


@cache
def activate(wanted: str = "auto", threads: int = 0) -> Backend:
    """Set the Mitsuba variant of this process; threads = 0 keeps Dr.Jit's choice (all cores). Call before rendering.

    Raises UserError as `choose` does, and where this process renders with another variant already.
    """
    backend = choose(wanted)
    # The doctor asks this module, too, and works where there is no Dr.Jit
    import drjit as dr
    import mitsuba as mi

    if mi.variant() not in (None, backend.variant):
        raise UserError(f"backend: expected {mi.variant()}, which this process renders with already, got "
                        f"{backend.variant}; start another process for it")
    mi.set_variant(backend.variant)
    mi.set_log_level(mi.LogLevel.Error)
    if threads:
        dr.set_thread_count(threads)
    return backend


def active() -> str:
    """What `activate` was called for in this process: cuda or llvm."""
    import mitsuba as mi

    return "cuda" if mi.variant().startswith("cuda") else "llvm"
