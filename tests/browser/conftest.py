"""A browser for tests of pages: Chromium without a window, or none and the reason."""

import os
import shutil
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

QUIET = ("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync")
NOISE = ("GL Driver Message", "willReadFrequently")
"""What Chromium says of itself where it has no GPU, and of tests that read pixels."""


@pytest.fixture(scope="session")
def browser() -> "Iterator[Browser]":
    """Chromium, one for all tests."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    with sync_api.sync_playwright() as playwright:
        own = playwright.chromium.executable_path
        found = os.environ.get("CHROMIUM") or shutil.which("chromium") or (own if Path(own).exists() else None)
        if found is None:
            pytest.skip("no Chromium is installed (Debian's package `chromium`, or set CHROMIUM to its path)")
        opened = playwright.chromium.launch(executable_path=found, args=list(QUIET))
        yield opened
        opened.close()


@pytest.fixture
def page(browser: "Browser") -> "Iterator[Page]":
    """A page of 1280 x 900 that must neither fail nor complain nor ask another host for anything."""
    faults: list[str] = []
    with browser.new_context(viewport={"width": 1280, "height": 900}) as context:
        opened = context.new_page()
        opened.set_default_timeout(30000)
        opened.on("pageerror", lambda error: faults.append(str(error)))
        opened.on("console", lambda line: faults.append(line.text)
                  if line.type in ("error", "warning") and not any(each in line.text for each in NOISE) else None)
        opened.on("dialog", lambda dialog: (faults.append(f"dialog: {dialog.message}"), dialog.dismiss()))
        opened.on("request", lambda request: None if request.url.startswith(("file:", "data:", "blob:", "http://127."))
                  else faults.append(f"request: {request.url}"))
        yield opened
    assert faults == []


class _Silent(SimpleHTTPRequestHandler):
    """What `python -m http.server` answers with, without its lines."""

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    """Where `tmp_path` is served over http."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(_Silent, directory=str(tmp_path))) as server:
        thread = Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()
