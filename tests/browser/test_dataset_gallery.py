"""The gallery of a dataset as `inspect --html` writes it: what a person sees of it is what a reader reads."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dataset_builder.cli.main import main
from dataset_builder.shards.reader import open_dataset
from tests.file_servers import free_port
from tests.report.gallery.shown_dataset import LOST, build_shown
from tests.shards.tiny_dataset import HEIGHT, WIDTH

if TYPE_CHECKING:
    from playwright.sync_api import Page


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The dataset, and its gallery in both forms."""
    folder = tmp_path_factory.mktemp("site")
    build_shown(folder / "tiny")
    for out in ("gallery", "gallery.html"):
        assert main(["inspect", str(folder / "tiny"), "--html", str(folder / out)]) == 0
    return folder


@pytest.fixture(scope="module")
def address(site: Path) -> Iterator[str]:
    """Where Python's own server serves the gallery's folder."""
    port = free_port()
    command = [sys.executable, "-u", "-m", "http.server", str(port), "--bind", "127.0.0.1", "-d", str(site / "gallery")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as server:
        assert server.stdout is not None and b"Serving" in server.stdout.readline()
        yield f"http://127.0.0.1:{port}/"
        server.terminate()


@pytest.mark.parametrize("where", ["http", "folder", "file"])
def test_what_is_seen_is_what_is_read(page: "Page", site: Path, address: str, where: str, tmp_path: Path) -> None:
    page.goto({"http": address, "folder": (site / "gallery" / "index.html").as_uri(),
               "file": (site / "gallery.html").as_uri()}[where])
    assert page.title() == "Tiny 1.0.0"
    assert page.locator("[data-count] b").inner_text() == "4"
    assert page.locator(".thumb img").first.evaluate("image => image.decode().then(() => image.naturalWidth)") == WIDTH
    page.locator("[data-filter=split]").select_option("test")
    page.locator("[data-card='00000003']").click()
    picture = page.locator("canvas[data-layer=i_t]")
    picture.wait_for()
    box = picture.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 5.5 * box["width"] / WIDTH, box["y"] + 2.5 * box["height"] / HEIGHT)
    example = open_dataset(site / "tiny")["00000003"]
    for layer in ("i_t", "d", "mask"):
        shown = page.locator(f"[data-values={layer}]").inner_text().split()
        assert [np.float16(text) for text in shown] == list(example[layer][2, 5].astype(np.float16)), layer
    page.screenshot(path=tmp_path / "opened.png")


def test_a_rejected_example_is_opened(page: "Page", address: str) -> None:
    page.goto(address)
    page.get_by_role("button", name="Rejected (2)").click()
    rows = page.locator(".rejected tbody tr")
    assert "3 <b>NaN</b> in i_t" in rows.nth(1).inner_text()
    assert rows.nth(0).get_by_role("button").count() == 0
    rows.nth(1).get_by_role("button", name="Look").click()
    page.get_by_role("heading", name="Rejected example").wait_for()
    page.locator("canvas[data-layer=i_t]").wait_for()
    head = page.locator(".head").inner_text()
    assert "finite: 3 <b>NaN</b> in i_t" in head and LOST in head
