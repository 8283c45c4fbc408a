"""The renderer's modules can be imported before a backend is chosen, and do not choose one themselves."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from dataset_builder.engine.source import read_sources
from dataset_builder.rendering.backend import find_llvm

MODULES = sorted(f"dataset_builder.{name}" for name in read_sources() if name.split(".")[0] == "rendering")
COMPUTE = """
from dataset_builder.rendering.backend import activate
activate("llvm")
import mitsuba as mi
assert (mi.Float(1) + 1)[0] == 2
"""


def python(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """A new process that runs some code, told nothing of a libLLVM."""
    kept = {name: value for name, value in os.environ.items() if name != "DRJIT_LIBLLVM_PATH"}
    return subprocess.run([sys.executable, "-c", code], env=kept | environment, capture_output=True, text=True)


def test_every_module_is_imported_without_a_variant() -> None:
    done = python(f"import {', '.join(MODULES)}; import mitsuba; assert mitsuba.variant() is None")
    assert len(MODULES) > 30 and done.returncode == 0, done.stderr


def test_verbs_that_render_nothing_do_not_wait_for_mitsuba() -> None:
    done = python("import sys, dataset_builder.builder, dataset_builder.report.console, dataset_builder.report.doctor\n"
                  "assert not {'mitsuba', 'drjit'} & set(sys.modules)")
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="libraries are named and searched for otherwise")
@pytest.mark.parametrize(("first", "works"), [
    ("import drjit", False), ("import dataset_builder.rendering.passes", True)])
def test_importing_names_a_library_before_dr_jit_looks_for_one(tmp_path: Path, first: str, works: bool) -> None:
    """What is found first by its name alone is no libLLVM."""
    assert find_llvm() is not None
    (tmp_path / "libLLVM.so").symlink_to(Path(find_spec("drjit").origin).with_name("libnanothread.so"))
    done = python(f"{first}\n{COMPUTE}", LD_LIBRARY_PATH=str(tmp_path))
    assert (done.returncode == 0) == works, done.stderr
