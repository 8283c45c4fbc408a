"""The page of a running build in a browser: it follows the file, and says when nothing was heard for long."""

import re
from pathlib import Path
from time import time
from typing import TYPE_CHECKING, Any

import pytest

from dataset_builder.files import write_atomic
from dataset_builder.report.front.fill_page import fill
from dataset_builder.report.watched_page import SCRIPTS, STYLES, TEMPLATE

if TYPE_CHECKING:
    from playwright.sync_api import Page

HOSTILE = "</script><b id=mine>bold</b>"


def write(path: Path, **changed: Any) -> None:
    """A page that was written just now, unless it is said otherwise."""
    values: dict[str, Any] = {
        "title": "small: running", "name": HOSTILE, "state": "running", "reasons": [], "about": {"spec": HOSTILE},
        "every": 0.2, "written": f"{time():.1f}", "written_text": "now", "done": 1234, "wanted": 5000, "kept": 0,
        "share": 0.25, "rate": "2.31/s", "left": "27 min 10 s", "elapsed": "9 min 00 s", "rejected": 0, "gates": {},
        "noise": [(HOSTILE, "3.1%", 1.0)], "goals": [], "fields": [], "pictures": [], "curve": {}}
    write_atomic(path, fill(TEMPLATE, scripts=SCRIPTS, styles=STYLES, **values | changed).encode())


@pytest.mark.parametrize("served", [False, True])
def test_a_page_follows_its_file(page: "Page", tmp_path: Path, address: str, served: bool) -> None:
    file = tmp_path / "small.html"
    write(file, every=1)
    page.goto(f"{address}/small.html" if served else file.as_uri())
    assert page.locator("#done").inner_text() == "1,234 of 5,000"
    assert page.locator("#left").inner_text() == "27 min 10 s"
    assert page.locator("#mine").count() == 0 and page.locator("h1").inner_text().startswith(HOSTILE)
    write(file, every=60, done=5000, state="finished", title="small: finished")
    page.wait_for_selector("main[data-state=finished]")
    assert page.locator("#done").inner_text() == "5,000 of 5,000" and page.title() == "small: finished"
    assert page.locator("#stale").is_hidden() and page.locator("#away").is_hidden()
    page.goto("about:blank")


def test_a_build_that_died_does_not_look_alive(page: "Page", tmp_path: Path) -> None:
    file = tmp_path / "small.html"
    write(file, every=60, written=f"{time() - 290:.1f}")
    page.goto(file.as_uri())
    assert page.locator("#stale").is_hidden()
    write(file, every=60, written=f"{time() - 310:.1f}")
    page.reload()
    assert page.locator("#stale").is_visible()
    assert "Not heard of for 5 min" in re.sub(r"\s+", " ", page.locator("#stale").inner_text())
    write(file, every=60, written=f"{time() - 3 * 3600 - 130:.1f}")
    page.reload()
    assert "Not heard of for 3 h 2 min" in re.sub(r"\s+", " ", page.locator("#stale").inner_text())
    assert page.locator("body").get_attribute("class") == "stale"
    write(file, every=60, written="0", state="finished")
    page.reload()
    assert page.locator("#stale").is_hidden()


def test_a_page_whose_server_is_gone_says_so_and_comes_back(page: "Page", tmp_path: Path, address: str) -> None:
    file = tmp_path / "small.html"
    write(file)
    page.goto(f"{address}/small.html")
    page.route("**/small.html", lambda route: route.fulfill(status=200, body="<p>Sign in</p>"))
    page.wait_for_selector("#away:not([hidden])")
    assert page.locator("#done").inner_text() == "1,234 of 5,000"
    page.unroute("**/small.html")
    page.wait_for_selector("#away", state="hidden")
    # The server ends before the page does
    page.goto("about:blank")
