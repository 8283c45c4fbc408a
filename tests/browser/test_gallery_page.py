"""The gallery, driven as a person drives it, from a file and over http."""

from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from dataset_builder.report.front.fill_page import script_json
from dataset_builder.report.front.pages import gallery_page
from dataset_builder.report.gallery.example_payload import example_payload
from tests.browser.made_up import HOSTILE, gallery, lit_ball

if TYPE_CHECKING:
    from playwright.sync_api import Page

COUNT, OPENED = 60, 4
INSIDE, FOLDER = gallery(COUNT), gallery(COUNT, "examples/")
EXAMPLES: list[dict[str, Any]] = INSIDE["examples"]
FILTERS = {"split": "test", "scene": "loft", "object": HOSTILE, "category": "decor", "light": "1", "lights": "point",
           "level_name": "heavy"}


def payload(index: int) -> dict[str, Any]:
    """What the viewer shows of an example."""
    return example_payload(lit_ball(index), key=f"{index:08d}", title=f"{EXAMPLES[index]['object']} {index}")


@pytest.fixture
def one_file(page: "Page", tmp_path: Path) -> "Page":
    """A gallery with the first payloads inside, opened from its file."""
    head = '<script type="application/json" data-key="'
    elements = "\n".join(f'{head}{index:08d}">{script_json(payload(index))}</script>' for index in range(OPENED))
    (tmp_path / "gallery.html").write_text(gallery_page(INSIDE, elements), encoding="utf-8")
    page.goto((tmp_path / "gallery.html").as_uri())
    return page


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A gallery as a folder; the script of one example is damaged, others are not there."""
    (tmp_path / "examples").mkdir()
    (tmp_path / "index.html").write_text(gallery_page(FOLDER), encoding="utf-8")
    for index in range(OPENED):
        text = f"galleryExample({script_json(payload(index))});"
        (tmp_path / "examples" / f"{index:08d}.js").write_text(text, encoding="utf-8")
    return tmp_path


def shown(page: "Page") -> int:
    """How many examples pass the filters, as the page says."""
    return int(page.locator("[data-count] b").inner_text())


def keys(page: "Page") -> list[str]:
    """Keys of the cards in the page, in order."""
    return [card.get_attribute("data-card") or "" for card in page.locator("[data-card]").all()]


def worst(example: dict[str, Any]) -> float:
    """Largest relative error of an example's layers."""
    return max(example["errors"].values())


def test_filters(one_file: "Page") -> None:
    for field, value in FILTERS.items():
        one_file.locator(f"[data-filter={field}]").select_option(value)
        expected = [example["key"] for example in EXAMPLES if str(example[field]) == value]
        assert shown(one_file) == len(expected) > 0, field
        assert keys(one_file) == expected[:len(keys(one_file))]
        one_file.locator(f"[data-filter={field}]").select_option("")
    for field in ("scene", "lights"):
        one_file.locator(f"[data-filter={field}]").select_option(FILTERS[field])
    assert shown(one_file) == sum((one["scene"], one["lights"]) == ("loft", "point") for one in EXAMPLES)


def test_search_and_clear(one_file: "Page", tmp_path: Path) -> None:
    one_file.get_by_label("Search examples").fill("CHAIR kitchen")
    expected = [one["key"] for one in EXAMPLES if (one["object"], one["scene"]) == ("chair", "kitchen")]
    assert shown(one_file) == len(expected)
    one_file.screenshot(path=tmp_path / "search.png")
    one_file.get_by_role("button", name="Clear all filters").click()
    assert shown(one_file) == COUNT


def test_order(one_file: "Page") -> None:
    for name in ("seconds", "error", "noise", "object"):
        value: Any = worst if name == "error" else itemgetter(name)
        one_file.locator("[data-sort]").select_option(name)
        there = [one for one in EXAMPLES if value(one) is not None]
        expected = sorted(there, key=lambda one: (value(one), one["key"]))
        found = keys(one_file)
        assert found == [one["key"] for one in expected[:len(found)]], name
        one_file.locator("[data-turn]").click()
        assert keys(one_file)[0] == min(one["key"] for one in there if value(one) == value(expected[-1])), name


def test_a_histogram_filters_when_it_is_brushed(one_file: "Page", tmp_path: Path) -> None:
    plot = one_file.locator("[data-histogram=seconds]")
    box = plot.locator("svg").bounding_box()
    assert box is not None
    one_file.mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 9)
    one_file.mouse.down()
    one_file.mouse.move(box["x"] + box["width"] + 40, box["y"] + 9, steps=3)
    one_file.mouse.up()
    seconds = [one["seconds"] for one in EXAMPLES if one["seconds"] is not None]
    low, high = (float(text) for text in one_file.url.partition("seconds=")[2].split("%7E"))
    assert high == max(seconds)
    assert low == pytest.approx(min(seconds) + 0.25 * (max(seconds) - min(seconds)), rel=0.02)
    assert shown(one_file) == sum(value >= low for value in seconds)
    one_file.screenshot(path=tmp_path / "brushed.png")
    plot.get_by_label("Seconds, to").fill("9")
    plot.get_by_label("Seconds, to").press("Enter")
    assert shown(one_file) == sum(low <= value <= 9 for value in seconds)
    plot.get_by_role("button", name="all").click()
    assert shown(one_file) == COUNT


def test_errors_of_one_layer(one_file: "Page") -> None:
    one_file.get_by_label("Layer whose error counts").select_option("i_s")
    one_file.locator("[data-sort]").select_option("error")
    assert keys(one_file)[0] == min(EXAMPLES, key=lambda one: one["errors"]["i_s"])["key"]


def test_a_link_brings_back_the_view(one_file: "Page") -> None:
    one_file.locator("[data-filter=scene]").select_option("kitchen")
    one_file.locator("[data-sort]").select_option("seconds")
    one_file.locator("[data-turn]").click()
    address, before = one_file.url, keys(one_file)
    one_file.goto("about:blank")
    one_file.goto(address)
    assert keys(one_file) == before
    assert one_file.locator("[data-filter=scene]").input_value() == "kitchen"


def test_the_viewer_opens_and_goes_on_by_keys(one_file: "Page", tmp_path: Path) -> None:
    one_file.locator("[data-card='00000001']").focus()
    one_file.keyboard.press("ArrowRight")
    one_file.keyboard.press("Enter")
    heading = one_file.locator("h1")
    assert heading.inner_text() == payload(2)["title"]
    one_file.screenshot(path=tmp_path / "opened.png")
    for key, index in (("ArrowRight", 3), ("ArrowLeft", 2), ("ArrowLeft", 1)):
        one_file.keyboard.press(key)
        one_file.get_by_role("heading", name=payload(index)["title"]).wait_for()
    assert one_file.url.endswith("open=00000001")
    one_file.keyboard.press("Escape")
    assert shown(one_file) == COUNT
    one_file.locator("[data-card='00000003']").click()
    heading.wait_for()
    one_file.go_back()
    one_file.locator("[data-card='00000003']").wait_for()


def test_what_is_not_there_is_told(one_file: "Page") -> None:
    one_file.locator(f"[data-card='{OPENED:08d}']").click()
    assert "does not hold the layers" in one_file.get_by_role("alert").inner_text()


def test_rejected_examples_have_their_reasons(one_file: "Page", tmp_path: Path) -> None:
    one_file.get_by_role("button", name="Rejected (1)").click()
    row = one_file.locator(".rejected tbody tr").inner_text()
    assert "coverage" in row
    assert INSIDE["rejected"][0]["reason"] in row
    one_file.screenshot(path=tmp_path / "rejected.png")


def test_nothing_of_a_dataset_is_html(one_file: "Page") -> None:
    assert one_file.title() == INSIDE["title"] == one_file.locator("h1").inner_text()
    assert HOSTILE in one_file.locator(".cards").inner_text()
    assert one_file.locator("img:not(.thumb img)").count() == 0


@pytest.mark.parametrize("over_http", [False, True])
def test_a_folder_loads_examples_when_they_are_asked_for(page: "Page", folder: Path, address: str,
                                                         over_http: bool) -> None:
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url.rpartition("/")[2]))
    page.goto(f"{address}/index.html" if over_http else (folder / "index.html").as_uri())
    assert not [name for name in asked if name.endswith(".js")]
    for index in (1, 2):
        page.locator(f"[data-card='{index:08d}']").click()
        page.get_by_role("heading", name=payload(index)["title"]).wait_for()
        page.get_by_role("button", name="← Gallery").click()
    assert [name for name in asked if name.endswith(".js")] == ["00000001.js", "00000002.js"]


def test_the_script_of_another_example_is_refused(page: "Page", folder: Path) -> None:
    (folder / "examples" / "00000000.js").write_bytes((folder / "examples" / "00000001.js").read_bytes())
    page.goto((folder / "index.html").as_uri())
    page.locator("[data-card='00000000']").click()
    assert "holds another example" in page.get_by_role("alert").inner_text()


def test_a_narrow_window_has_no_sideways_scroll(one_file: "Page", tmp_path: Path) -> None:
    one_file.set_viewport_size({"width": 800, "height": 900})
    one_file.screenshot(path=tmp_path / "narrow.png")
    assert one_file.evaluate("document.documentElement.scrollWidth") == 800
    one_file.locator("[data-card='00000000']").click()
    one_file.locator("h1").wait_for()
    one_file.screenshot(path=tmp_path / "narrow-opened.png")
    assert one_file.evaluate("document.documentElement.scrollWidth") == 800


def test_only_cards_near_the_window_are_there(one_file: "Page") -> None:
    one_file.set_viewport_size({"width": 800, "height": 400})
    one_file.evaluate("window.scrollTo(0, document.body.scrollHeight)")
    one_file.locator(f"[data-card='{COUNT - 1:08d}']").wait_for()
    # Cards that were left behind go away with the next frame, which is late on a busy machine
    one_file.wait_for_function(f"document.querySelectorAll('[data-card]').length < {COUNT}")
