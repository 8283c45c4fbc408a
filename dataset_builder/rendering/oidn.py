"""Intel Open Image Denoise, by way of `pyoidn`: one image in, one image out. Nobody else knows the library.

Afra, "Intel Open Image Denoise", https://www.openimagedenoise.org: a U-Net trained on path-traced images. The same
image gives the same bits, whatever the number of threads, on processors with the same vector unit.
"""

import importlib.metadata
from functools import cache
from typing import Any

import numpy as np

from dataset_builder.errors import UserError

PACKAGE = "pyoidn"
INSTALL = 'pip install "3df-lighting-builder[denoise]"'
MARGIN = 16
"""Pixels of mirrored image around what is filtered: without them a constant image comes back wrong by a sixth at its
border, with them by a quarter of a percent."""


def require() -> str:
    """Name and version of the denoiser. Raises UserError where it is not installed or does not run on this machine."""
    try:
        import pyoidn

        runs = pyoidn.Device.is_cpu_available()
    except ImportError as error:
        raise UserError(f"render.denoise: expected Open Image Denoise, but {PACKAGE} is not installed; {INSTALL}, or "
                        "leave out render.denoise") from error
    except OSError as error:
        raise _refused(str(error)) from error
    if not runs:
        raise _refused("no support for this processor")
    return f"{PACKAGE} {importlib.metadata.version(PACKAGE)}"


def denoise(image: np.ndarray, albedo: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(H, W, 3) float32 estimate of the noise-free image, never below 0.

    image: (H, W, 3) finite linear radiance; albedo: (H, W, 3) in [0, 1]; normal: (H, W, 3) in [-1, 1], world space;
    both free of noise. Raises UserError as `require` does, RuntimeError where the library fails.
    """
    padded = {"color": _padded(image), "albedo": _padded(albedo), "normal": _padded(normal)}
    output = np.empty_like(padded["color"])
    _execute({**padded, "output": output})
    height, width = image.shape[:2]
    return np.maximum(output[MARGIN:MARGIN + height, MARGIN:MARGIN + width], np.float32(0))


def _padded(image: np.ndarray) -> np.ndarray:
    around = ((MARGIN, MARGIN), (MARGIN, MARGIN), (0, 0))
    return np.ascontiguousarray(np.pad(image.astype(np.float32, copy=False), around, mode="symmetric"))


def _execute(images: dict[str, np.ndarray]) -> None:
    """Run one filter; it holds pointers into the images, so it ends before they do."""
    import pyoidn

    rt = pyoidn.Filter(_device(), pyoidn.OIDN_FILTER_TYPE_RT)
    # Not `with`: the library's filters swallow exceptions
    try:
        for name, image in images.items():
            rt.set_image(name, image, pyoidn.OIDN_FORMAT_FLOAT3)
        rt.set_bool("hdr", True)
        rt.set_bool("cleanAux", True)
        rt.set_quality(pyoidn.OIDN_QUALITY_HIGH)
        rt.commit()
        rt.execute()
    finally:
        rt.release()
    if message := _device().get_error():
        raise RuntimeError(f"Open Image Denoise failed: {message}")


@cache
def _device() -> Any:
    """The device of this process, with as many threads as Dr.Jit has: processes of a build share the cores."""
    # The doctor asks `require`, too, and works where there is no Dr.Jit
    import drjit as dr

    require()
    import pyoidn

    device = pyoidn.Device(pyoidn.OIDN_DEVICE_TYPE_CPU)
    device.set_int("numThreads", max(1, dr.thread_count()))
    device.set_bool("setAffinity", False)
    device.commit()
    if message := device.get_error():
        raise _refused(message)
    return device


def _refused(reason: str) -> UserError:
    return UserError(f"render.denoise: expected Open Image Denoise to run on this machine, got: {reason}")
