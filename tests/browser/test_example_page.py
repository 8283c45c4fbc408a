"""The layer viewer, driven as a person drives it; what it shows is compared with Python's own numbers."""

from base64 import b64decode
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dataset_builder import tonemap
from dataset_builder.report.front.pages import examples_page
from dataset_builder.report.gallery.example_payload import example_payload
from tests.browser.made_up import HOSTILE, SIZE, lit_ball

if TYPE_CHECKING:
    from playwright.sync_api import Page

PIXELS = """async name => { await new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)));
const canvas = document.querySelector(`canvas[data-layer="${name}"]`);
const bytes = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
let text = ""; for (const byte of bytes) text += String.fromCharCode(byte); return btoa(text); }"""
EXAMPLES = [lit_ball(0), lit_ball(1)]


@pytest.fixture
def viewer(page: "Page", tmp_path: Path) -> "Page":
    """The page of two examples, opened from its file."""
    payloads = [example_payload(EXAMPLES[0], title="First", note="preview at 8 spp"),
                example_payload(EXAMPLES[1], title=HOSTILE)]
    (tmp_path / "example.html").write_text(examples_page("Examples", payloads, ["Two examples."]), encoding="utf-8")
    page.goto((tmp_path / "example.html").as_uri())
    page.wait_for_selector("canvas[data-layer=i_t]")
    return page


def pixels(page: "Page", layer: str) -> np.ndarray:
    """(H, W, 3) uint8 of a canvas."""
    return np.frombuffer(b64decode(page.evaluate(PIXELS, layer)), np.uint8).reshape(SIZE, SIZE, 4)[..., :3]


def expected(layer: str, factor: float, example: int = 0) -> np.ndarray:
    """What the package makes of the same half floats."""
    return tonemap.to_8bit(EXAMPLES[example][layer].astype(np.float16), factor)


def exposure(page: "Page") -> float:
    """The factor that the viewer works with."""
    return float(page.locator("[data-factor]").get_attribute("data-factor") or "")


def set_slider(page: "Page", label: str, value: float) -> None:
    """Move a slider to a value, as its keys do."""
    page.get_by_label(label).evaluate("""(slider, value) => { slider.value = value;
        slider.dispatchEvent(new Event("input", { bubbles: true })); }""", value)


def point(page: "Page", layer: str, x: int, y: int) -> None:
    """Move the pointer to a pixel of a picture."""
    box = page.locator(f"canvas[data-layer={layer}]").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + (x + 0.5) * box["width"] / SIZE, box["y"] + (y + 0.5) * box["height"] / SIZE)


def test_one_exposure_moves_all_light_and_nothing_else(viewer: "Page", tmp_path: Path) -> None:
    before = exposure(viewer)
    assert before == pytest.approx(tonemap.exposure([EXAMPLES[0]["i_s"], EXAMPLES[0]["i_t"]]), rel=0.01)
    mask = pixels(viewer, "mask")
    for stops in (0.0, 1.5, -3.0):
        set_slider(viewer, "Exposure in stops", stops)
        viewer.wait_for_timeout(50)
        assert exposure(viewer) == pytest.approx(before * 2**stops)
        for layer in ("i_s", "i_t"):
            np.testing.assert_array_equal(pixels(viewer, layer), expected(layer, exposure(viewer)))
    np.testing.assert_array_equal(pixels(viewer, "mask"), mask)
    viewer.screenshot(path=tmp_path / "dark.png")
    viewer.get_by_role("button", name="Automatic").click()
    np.testing.assert_array_equal(pixels(viewer, "i_t"), expected("i_t", before))


def test_the_pointer_reads_values_and_standard_errors(viewer: "Page", tmp_path: Path) -> None:
    point(viewer, "i_t", 14, 9)
    for layer in ("i_t", "i_s", "mask", "depth", "normal"):
        shown = viewer.locator(f"[data-values={layer}]").inner_text().split()
        values = EXAMPLES[0][layer][9, 14].astype(np.float16)
        assert [np.float16(text) for text in shown] == list(values), layer
    shown = viewer.locator("[data-spread=i_t]").inner_text().removeprefix("±").split()
    assert [np.float16(text) for text in shown] == list(EXAMPLES[0]["i_t_se"][9, 14].astype(np.float16))
    said = viewer.locator("[data-spread=i_s]").inner_text()
    assert said == "no error per pixel; relative error 3.4 %"
    assert viewer.locator("[data-spread=mask]").inner_text() == "no error per pixel"
    assert "pixel 14, 9" in viewer.locator(".head").inner_text()
    viewer.screenshot(path=tmp_path / "pointed.png")


def test_keys_read_pixels_too(viewer: "Page") -> None:
    viewer.locator("canvas[data-layer=i_t]").locator("..").focus()
    for key in ("ArrowLeft", "ArrowLeft", "ArrowDown"):
        viewer.keyboard.press(key)
    assert f"pixel {SIZE // 2 - 2}, {SIZE // 2 + 1}" in viewer.locator(".head").inner_text()


def test_false_colour_of_light_follows_the_exposure(viewer: "Page") -> None:
    viewer.get_by_label("false colour").check()
    low, high = viewer.locator("figure", has=viewer.locator("canvas[data-layer=i_t]")).locator(".scale span").all()
    assert low.inner_text() == "0"
    assert float(high.inner_text()) == pytest.approx(1 / exposure(viewer), rel=5e-3)
    assert pixels(viewer, "i_t")[0, 0].tolist() != expected("i_t", exposure(viewer))[0, 0].tolist()
    ends = viewer.locator("figure", has=viewer.locator("canvas[data-layer=depth]")).locator(".scale span").all()
    seen = EXAMPLES[0]["depth"][EXAMPLES[0]["depth"] > 0]
    assert [float(end.inner_text()) for end in ends] == pytest.approx([seen.min(), seen.max()], rel=0.01)


def test_the_wiper_shows_one_layer_on_each_side(viewer: "Page", tmp_path: Path) -> None:
    viewer.get_by_role("button", name="Wiper").click()
    viewer.get_by_label("left").select_option("mask")
    viewer.get_by_label("right").select_option("i_t")
    box = viewer.locator(".stack").bounding_box()
    assert box is not None
    viewer.mouse.move(box["x"] + 10, box["y"] + 10)
    viewer.mouse.down()
    viewer.mouse.move(box["x"] + box["width"] / 4, box["y"] + 10)
    viewer.mouse.up()
    assert float(viewer.get_by_label("Place of the wiper").input_value()) == pytest.approx(25, abs=1)
    assert "25%" in viewer.locator(".stack .canvas").nth(1).evaluate("one => one.style.clipPath")
    viewer.mouse.move(0, 0)
    viewer.screenshot(path=tmp_path / "wiper.png")
    np.testing.assert_array_equal(pixels(viewer, "i_t"), expected("i_t", exposure(viewer)))


def test_sizes_are_whole_multiples(viewer: "Page") -> None:
    for times in (1, 2, 4):
        viewer.get_by_role("button", name=f"{times}×").click()
        box = viewer.locator("canvas[data-layer=i_t]").bounding_box()
        assert box is not None
        assert (box["width"], box["height"]) == (times * SIZE, times * SIZE)


def test_layers_can_be_left_out(viewer: "Page") -> None:
    viewer.get_by_role("button", name="normal").click()
    assert viewer.locator("canvas[data-layer=normal]").count() == 0
    assert viewer.locator("canvas").count() == len(EXAMPLES[0]) - 2


def test_the_label_folds_and_is_searched(viewer: "Page") -> None:
    tree = viewer.get_by_role("region", name="Label")
    assert "focal" not in tree.inner_text()
    tree.locator("summary", has_text="camera").click()
    tree.get_by_text("35.5").wait_for()
    tree.get_by_role("searchbox").fill("Relative_Err")
    assert "0.021" in tree.inner_text()
    assert "camera" not in tree.inner_text()
    tree.get_by_role("searchbox").fill("")
    tree.locator("summary", has_text="camera").wait_for()
    assert "0.021" not in tree.inner_text(), "what only the search has unfolded"
    tree.get_by_role("searchbox").fill("no such thing")
    assert "Nothing matches." in tree.inner_text()


def test_names_are_no_html_and_another_example_keeps_a_held_exposure(viewer: "Page") -> None:
    viewer.get_by_label("hold").check()
    held = exposure(viewer)
    viewer.locator(".tabs button").nth(1).click()
    viewer.wait_for_function("document.querySelector('h1').textContent.includes('onerror')")
    assert viewer.locator("h1").inner_text() == HOSTILE
    viewer.wait_for_timeout(100)
    assert exposure(viewer) == held
    np.testing.assert_array_equal(pixels(viewer, "i_t"), expected("i_t", held, example=1))
    assert viewer.locator("img").count() == 0
    set_slider(viewer, "Exposure in stops", 2)
    viewer.get_by_role("button", name="Automatic").click()
    assert not viewer.get_by_label("hold").is_checked()
    own = tonemap.exposure([EXAMPLES[1][name].astype(np.float16) for name in ("i_s", "i_t", "s_prime")
                            if name in EXAMPLES[1]])
    assert exposure(viewer) == pytest.approx(own, rel=2e-3)
    assert held != pytest.approx(own, rel=2e-3)


def test_damaged_layers_are_told(page: "Page", tmp_path: Path) -> None:
    payload = example_payload(EXAMPLES[0])
    payload["width"] += 1
    (tmp_path / "damaged.html").write_text(examples_page("Damaged", [payload]), encoding="utf-8")
    page.goto((tmp_path / "damaged.html").as_uri())
    assert "cannot be decoded: expected" in page.get_by_role("alert").inner_text()
