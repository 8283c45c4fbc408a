"""The page of one example, in a browser: what it is on top, every layer below."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.engine.rejected_pixels import keep_pixels
from dataset_builder.report.one_example import write_example, write_rejected
from dataset_builder.seeding import rng
from dataset_builder.shards.manifest import Rejected

if TYPE_CHECKING:
    from playwright.sync_api import Page

LAYERS = ("i_t", "mask", "depth", "i_t_se")
REJECTED = Rejected(key="00000001", view="train/000000", gate="coverage", reason="expected <b>0.9</b>, got 0.5")


def layers() -> dict[str, np.ndarray]:
    draw = rng(1, "layers")
    return {name: draw.random((24, 32, 3 if name.startswith("i_t") else 1), dtype=np.float32) for name in LAYERS}


def test_every_layer_is_shown_below_what_it_is(page: "Page", tmp_path: Path) -> None:
    found = write_example(layers(), "00000007", tmp_path, lead=["A title 1.0.0"], note="staged")
    page.goto(found.page.as_uri())
    page.wait_for_function(f"document.querySelectorAll('canvas').length === {len(LAYERS)}")
    text = page.inner_text("body")
    assert text.index("A title 1.0.0") < text.index("example 00000007") < text.index("i_t_se")
    page.screenshot(path=tmp_path / "page.png", full_page=True)


def test_a_rejected_example_has_its_reason_on_top(page: "Page", tmp_path: Path) -> None:
    bare = write_rejected(REJECTED, tmp_path, tmp_path / "bare", about="A title 1.0.0")
    page.goto(bare.page.as_uri())
    text = page.inner_text("body")
    assert text.startswith("example 00000001") and "coverage: expected <b>0.9</b>, got 0.5" in text
    assert page.query_selector("b") is None
    page.screenshot(path=tmp_path / "bare.png")
    keep_pixels(tmp_path, REJECTED.key, layers())
    page.goto(write_rejected(REJECTED, tmp_path, tmp_path / "out", about="A title 1.0.0").page.as_uri())
    page.wait_for_function(f"document.querySelectorAll('canvas').length === {len(LAYERS)}")
    assert "coverage: expected <b>0.9</b>, got 0.5" in page.inner_text("body")
