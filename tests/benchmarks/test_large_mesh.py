"""The scan that the benchmark of large meshes makes."""

import pytest

from benchmarks.large_mesh import scan
from dataset_builder.geometry.repair import repair
from dataset_builder.geometry.shape_faults import shape_faults


def test_a_scan_is_one_sound_surface_without_shared_vertices() -> None:
    raw = scan(20_000)
    assert len(raw.faces) == pytest.approx(20_000, rel=0.05) and len(raw.positions) == 3 * len(raw.faces)
    mended, report = repair(raw)
    # Euler's formula of a sphere
    assert len(mended.positions) == len(raw.faces) / 2 + 2
    assert (report.closed, report.pieces, report.turned, report.inside_out, report.degenerate) == (1, 1, 0, 0, 0)
    assert 4 < mended.volume < 4.4 and shape_faults(mended).notes == []
