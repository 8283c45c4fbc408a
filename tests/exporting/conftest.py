"""One example, exported once."""

from pathlib import Path

import pytest

from dataset_builder.exporting.export_usd import Exported, ExportJob, export_usd
from dataset_builder.shards.reader import open_dataset

KEY = "00000001"
"""The first view under its first light, with noise."""


@pytest.fixture(scope="session")
def exported(small_dataset: Path, small_spec: Path, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    """The stage of example `KEY` of the small dataset; not to be changed."""
    out = tmp_path_factory.mktemp("exported") / "stage"
    return export_usd(ExportJob(dataset=small_dataset, key=KEY, out=out, mesh_root=small_spec.parent))


@pytest.fixture(scope="session")
def label(small_dataset: Path):
    """Its label."""
    return open_dataset(small_dataset).label(KEY)
