"""Which backend is chosen on machines that have this and that."""

from collections.abc import Callable
from pathlib import Path

import pytest

from dataset_builder.errors import UserError
from dataset_builder.rendering import backend
from dataset_builder.rendering.backend import Backend, activate, choose, find_llvm, llvm_version, renderer_versions

Has = Callable[..., None]
DEBIAN = "/usr/lib/x86_64-linux-gnu/"


@pytest.fixture
def has(monkeypatch: pytest.MonkeyPatch) -> Has:
    """Makes this a machine with these libraries, with or without CUDA; names stand for files of Debian's folder."""

    def make(*names: str, cuda: bool = False, optix: bool = True) -> None:
        paths = [name if name.startswith("/") else DEBIAN + name for name in names]
        monkeypatch.setattr(backend.glob, "glob", lambda pattern: [path for path in paths if Path(path).match(pattern)])
        monkeypatch.setattr(backend, "cuda_available", lambda: cuda)
        monkeypatch.setattr(backend, "optix_available", lambda: optix)
        monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)

    return make


@pytest.mark.parametrize(("name", "version"), [
    ("libLLVM-19.so", 19), ("libLLVM-19.so.1", 19), ("libLLVM.so.19.1", 19), ("libLLVM.so.20.1", 20),
    ("libLLVM-14.so.1", 14), ("libLLVM.so", None), ("libLLVM.so.old", None), ("libLLVMDemangle.so", None)])
def test_versions_are_read_from_names(name: str, version: int | None) -> None:
    assert llvm_version(DEBIAN + name) == version


@pytest.mark.parametrize(("names", "chosen"), [
    (["libLLVM-17.so", "libLLVM-18.so.1", "libLLVM-19.so", "libLLVM-20.so", "libLLVM-15.so"], "libLLVM-19.so"),
    (["libLLVM-14.so", "libLLVM.so.19.1"], "libLLVM.so.19.1"),
    (["libLLVM-15.so", "libLLVM-17.so"], "libLLVM-17.so"),
    (["libLLVM-16.so", "libLLVM-21.so"], "libLLVM-21.so"),
    (["libLLVM.so", "libLLVM-18.so"], "libLLVM-18.so"),
    (["/usr/lib/llvm-19/lib/libLLVM.so", "/usr/lib/llvm-18/lib/libLLVM-18.so"], "/usr/lib/llvm-18/lib/libLLVM-18.so"),
])
def test_the_best_that_works_is_chosen(has: Has, names: list[str], chosen: str) -> None:
    has(*names)
    path = chosen if chosen.startswith("/") else DEBIAN + chosen
    assert find_llvm() == path
    assert choose() == choose("llvm")
    assert (choose().variant, choose().llvm) == ("llvm_ad_rgb", path) and path in choose().summary


@pytest.mark.parametrize("names", [[], ["libLLVM-14.so", "libLLVM-15.so.1", "libLLVM.so.16.0"], ["libLLVM.so"],
                                   ["libLLVM-13.so", "libLLVM-99.so"]])
def test_none_that_works_is_refused_with_the_command_that_mends_it(has: Has, names: list[str]) -> None:
    has(*names)
    assert find_llvm() is None
    for wanted in ("auto", "llvm"):
        with pytest.raises(UserError, match=r"no libLLVM of version 17 to 21 .*apt-get install -y libllvm19"):
            choose(wanted)


def test_what_the_user_names_goes_first(has: Has, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    has("libLLVM-19.so")
    mine = tmp_path / "libLLVM-18.so"
    mine.touch()
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(mine))
    assert choose("llvm").llvm == str(mine)
    mine.unlink()
    with pytest.raises(UserError, match=r"DRJIT_LIBLLVM_PATH: expected a libLLVM, found no file .*libLLVM-18\.so"):
        choose("llvm")


def test_cuda_goes_first_where_it_runs(has: Has) -> None:
    has("libLLVM-19.so", cuda=True)
    assert choose().variant == choose("cuda").variant == "cuda_ad_rgb" and choose().llvm == ""
    assert choose("llvm").variant == "llvm_ad_rgb"
    assert renderer_versions("auto")["variant"] == "cuda_ad_rgb" != renderer_versions("llvm")["variant"]


def test_cuda_that_is_not_there(has: Has) -> None:
    has("libLLVM-19.so")
    with pytest.raises(UserError, match="expected an NVIDIA GPU for cuda, but its driver reports none"):
        choose("cuda")
    with pytest.raises(UserError, match="expected auto, cuda or llvm, got 'metal'"):
        choose("metal")


def test_a_driver_without_optix_traces_no_rays(has: Has) -> None:
    """As in a container that asked for computing alone."""
    has("libLLVM-19.so", cuda=True, optix=False)
    assert choose().variant == "llvm_ad_rgb"
    with pytest.raises(UserError, match=r"found no libnvoptix\.so\.1; containers get it with NVIDIA_DRIVER_CAPAB"):
        choose("cuda")


def test_optix_is_looked_for_where_dr_jit_does(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("DRJIT_LIBOPTIX_PATH", str(tmp_path / "none.so"))
    assert not backend.optix_available()
    monkeypatch.setenv("DRJIT_LIBOPTIX_PATH", "libc.so.6")
    assert backend.optix_available()


def test_a_process_keeps_its_variant(monkeypatch: pytest.MonkeyPatch) -> None:
    activate("llvm")
    monkeypatch.setattr(backend, "choose", lambda wanted: Backend(variant="scalar_rgb", llvm="", summary=""))
    with pytest.raises(UserError, match=r"expected llvm_ad_rgb, which this process .*, got scalar_rgb"):
        activate("scalar")
