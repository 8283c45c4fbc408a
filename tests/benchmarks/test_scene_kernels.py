"""Scenes of every origin are rendered by the kernels of procedural rooms."""

from benchmarks.scene_kernels import ORIGINS, kernels
from dataset_builder.rendering import plugins
from dataset_builder.rendering.backend import activate


def test_scenes_from_files_need_no_other_kernel() -> None:
    activate("llvm")
    plugins.register()
    found = kernels(list(ORIGINS), 1)
    assert len(found) == len(ORIGINS) == 5
    assert found["procedural", 0] and set(found.values()) == {found["procedural", 0]}
