"""Memory in use, and what is said where it runs out."""

import pytest

from dataset_builder.errors import OutputError
from dataset_builder.rendering.device import bytes_in_use, memory_told


@pytest.mark.parametrize("error", [
    RuntimeError("jit_malloc(): out of memory! Could not allocate 8589934592 bytes (backend=cuda, shared=0)."),
    RuntimeError("OPTIX_ERROR_DEVICE_OUT_OF_MEMORY"), MemoryError()])
def test_a_renderer_without_memory_ends_with_a_reason(error: Exception) -> None:
    with pytest.raises(OutputError, match=r"^00000007: expected enough memory on this machine, got: .* --workers"), \
            memory_told("00000007"):
        raise error


def test_other_errors_stay_what_they_are() -> None:
    with pytest.raises(RuntimeError, match="another"), memory_told("00000007"):
        raise RuntimeError("another")


def test_memory_in_use_is_the_processs() -> None:
    assert 50e6 < bytes_in_use() < 64e9
