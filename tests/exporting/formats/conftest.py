"""A small dataset, and one whose examples of a view share files; what our reader makes of each."""

from collections.abc import Callable
from pathlib import Path

import pytest

from dataset_builder.exporting.export_dataset import DatasetExport, export_dataset
from dataset_builder.exporting.export_record import ExportFormat
from dataset_builder.shards.reader import open_dataset
from tests.ecosystem.pages import Truth, truth_of
from tests.shards.tiny_dataset import build

Export = Callable[[ExportFormat], Path]


@pytest.fixture(params=["each", "once"])
def dataset(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Four examples in three shards; the first two share a view."""
    build(tmp_path / "tiny", shared=request.param)
    return tmp_path / "tiny"


@pytest.fixture
def truth(dataset: Path) -> Truth:
    """What our reader makes of every example."""
    return truth_of(open_dataset(dataset))


@pytest.fixture
def exported(dataset: Path, tmp_path: Path) -> Export:
    """Exports the dataset, all of it; the folder."""
    def export(kind: ExportFormat) -> Path:
        done = export_dataset(DatasetExport(dataset=dataset, out=tmp_path / kind, kind=kind))
        assert done.examples == 4 and done.kept == 0
        return tmp_path / kind

    return export
