"""Photograph pages for the documentation: `python tools/page_pictures.py DATASET SPEC [FOLDER]`, half a minute.

Needs Chromium and the extra `test`. Writes `gallery.png`, the dataset's gallery, and `view.png`, example 0 of the spec
as `dataset-builder view` draws it, with 256 colours each.
"""

import sys
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

from PIL import Image
from playwright.sync_api import sync_playwright

from dataset_builder.cli.main import main as command

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
SIZE = {"width": 1280, "height": 850}
QUIET = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run")


def photograph(page: Path, target: Path) -> None:
    """Write what a browser shows of a page as a PNG file."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=which("chromium"), args=[*QUIET])
        shown = browser.new_page(viewport=SIZE)
        shown.goto(page.as_uri())
        shown.wait_for_load_state("networkidle")
        shown.screenshot(path=target)
        browser.close()


def reduced(source: Path, target: Path) -> None:
    """Write a picture with 256 colours."""
    Image.open(source).convert("RGB").quantize(256, dither=Image.Dither.FLOYDSTEINBERG).save(target, optimize=True)
    print(target)


def main(dataset: Path, spec: Path, folder: Path = IMAGES) -> None:
    """Make both pictures."""
    with TemporaryDirectory() as work:
        place = Path(work)
        if command(["inspect", str(dataset), "--html", str(place / "gallery")]):
            raise SystemExit("no gallery")
        photograph(place / "gallery" / "index.html", place / "gallery.png")
        if command(["view", str(spec), "--out", str(place / "view")]):
            raise SystemExit("no view")
        reduced(place / "gallery.png", folder / "gallery.png")
        reduced(place / "view" / "view.png", folder / "view.png")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
