"""Memory of what renders: how much is in use, and what is said where it does not suffice."""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager

from dataset_builder.errors import OutputError, Problem
from dataset_builder.rendering.backend import active

OUT_OF_MEMORY = ("out of memory", "CUDA_ERROR_OUT_OF_MEMORY", "OPTIX_ERROR_DEVICE_OUT_OF_MEMORY")


def bytes_in_use() -> int:
    """Bytes of the GPU's memory that are taken, by whatever process; of this process's memory where the CPU renders."""
    if active() == "llvm":
        import psutil

        return int(psutil.Process().memory_info().rss)
    free, total = device_bytes()
    return total - free


def device_bytes() -> tuple[int, int]:
    """(free, all) bytes of the first GPU. Raises OSError where its driver does not tell."""
    driver, device, context = ctypes.CDLL("libcuda.so.1"), ctypes.c_int(), ctypes.c_void_p()
    free, total = ctypes.c_size_t(), ctypes.c_size_t()
    _done(driver.cuInit(0), "cuInit")
    _done(driver.cuDeviceGet(ctypes.byref(device), 0), "cuDeviceGet")
    # The context that Dr.Jit has, too: none of our own, which would take memory
    _done(driver.cuDevicePrimaryCtxRetain(ctypes.byref(context), device), "cuDevicePrimaryCtxRetain")
    try:
        _done(driver.cuCtxPushCurrent_v2(context), "cuCtxPushCurrent")
        try:
            _done(driver.cuMemGetInfo_v2(ctypes.byref(free), ctypes.byref(total)), "cuMemGetInfo")
        finally:
            driver.cuCtxPopCurrent_v2(ctypes.byref(context))
    finally:
        driver.cuDevicePrimaryCtxRelease_v2(device)
    return free.value, total.value


def _done(code: int, what: str) -> None:
    if code:
        raise OSError(f"{what} failed with {code}")


@contextmanager
def memory_told(what: str) -> Iterator[None]:
    """Turn a renderer that has no memory left into an OutputError that says so; `what` was rendered."""
    try:
        yield
    except (RuntimeError, MemoryError) as error:
        if not isinstance(error, MemoryError) and not any(sign in str(error) for sign in OUT_OF_MEMORY):
            raise
        where = "the GPU" if active() == "cuda" else "this machine"
        rule = f"expected enough memory on {where}, got: {str(error) or 'none left'}"
        hint = "finished examples are kept: build with fewer --workers, smaller meshes or textures, or on a larger one"
        raise OutputError([Problem(where=what, path="", rule=rule, hint=hint)]) from error
