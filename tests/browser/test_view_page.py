"""The page of `view`, driven as a person drives it."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dataset_builder.cli.main import main
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.scene_plan import CameraPlan
from dataset_builder.report.arrangement_page import arrangement_page
from dataset_builder.report.looking.shown_arrangement import ShownArrangement
from dataset_builder.report.looking.standing import StandingThing
from dataset_builder.report.quick_render import QuickRender
from tests.browser.made_up import HOSTILE
from tests.small_specs import FILES, write_spec

if TYPE_CHECKING:
    from playwright.sync_api import Page

VIEWER = "(() => { const at = arrangementScene.viewer.position; return [at.x, at.y, at.z]; })()"
DARK = """(() => { const canvas = document.querySelector(".stage canvas"), scene = arrangementScene;
scene.draw(); const copy = document.createElement("canvas"); copy.width = canvas.width; copy.height = canvas.height;
const to = copy.getContext("2d"); to.drawImage(canvas, 0, 0);
const bytes = to.getImageData(0, 0, copy.width, copy.height).data;
let count = 0; for (let at = 0; at < bytes.length; at += 4) count += bytes[at + 2] < 240; return count; })()"""
"""Pixels that something is drawn on."""


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a view, without preview."""
    folder = tmp_path_factory.mktemp("view")
    spec = write_spec(folder / "specs")
    assert main(["view", str(spec), "--example", "2", "--no-preview", "--out", str(folder / "out")]) == 0
    return folder / "out"


def opened(page: "Page", file: Path) -> None:
    """Open a page, and wait until all of it is drawn."""
    page.goto(file.as_uri())
    page.wait_for_selector(".stage[data-ready=yes]")


def test_an_arrangement_turns_toggles_and_tells(page: "Page", written: Path, tmp_path: Path) -> None:
    opened(page, written / "view.html")
    assert page.locator("h1").inner_text() == "small: example 2"
    everything, start = page.evaluate(DARK), page.evaluate(VIEWER)
    assert everything > 10000
    box = page.locator(".stage canvas").bounding_box()
    assert box is not None
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(*middle)
    page.mouse.down()
    page.mouse.move(middle[0] + 150, middle[1], steps=3)
    page.mouse.up()
    turned = page.evaluate(VIEWER)
    assert np.linalg.norm(np.subtract(turned, start)) > 1
    assert turned[2] == pytest.approx(start[2], abs=1e-3)
    page.get_by_role("button", name="From above").click()
    for part in ("walls", "floor", "ceiling", "furniture"):
        page.get_by_label(part, exact=True).uncheck()
    assert page.evaluate(DARK) < everything / 2
    assert page.locator(".name-tag:visible", has_text="stool").count() == 0
    assert page.locator(".name-tag:visible", has_text="target 0").count() == 1
    page.get_by_label("names").uncheck()
    assert page.locator(".name-tag:visible").count() == 0
    page.locator("summary", has_text="things").click()
    first = page.locator(".thing").first
    first.click()
    assert page.locator(".side h2").first.inner_text() == first.inner_text()
    page.screenshot(path=tmp_path / "turned.png")


def test_what_is_above_and_near_is_cut_away_until_it_is_asked_for(page: "Page", written: Path) -> None:
    """A click on the middle of the room meets the building only while nothing of it is cut away."""
    opened(page, written / "view.html")
    for part in ("furniture", "lights", "camera"):
        page.get_by_label(part, exact=True).uncheck()
    place = page.evaluate("""(() => { const scene = arrangementScene, at = scene.centre.clone().project(scene.viewer);
        return [(at.x + 1) / 2 * scene.box.clientWidth, (1 - at.y) / 2 * scene.box.clientHeight]; })()""")
    met = {}
    for cut in (True, False):
        page.get_by_label("cut away").set_checked(cut)
        page.locator(".stage canvas").click(position={"x": place[0], "y": place[1]})
        met[cut] = page.locator(".side h2").first.inner_text()
    assert met[True] == page.locator(".thing").first.text_content().strip()
    assert met[False] in ("walls", "ceiling")


def test_through_the_camera_the_target_is_where_the_pinhole_has_it(page: "Page", written: Path) -> None:
    opened(page, written / "view.html")
    page.get_by_role("button", name="Through the camera").click()
    frame, stage = (page.locator(each).bounding_box() for each in (".picture-frame", ".stage canvas"))
    assert frame is not None
    assert stage is not None
    assert frame["width"] / frame["height"] == pytest.approx(24 / 20, rel=0.01)
    column, row = page.evaluate("""(() => { const at = arrangementScene.centre.clone().project(arrangementScene.viewer);
        return [(at.x + 1) / 2, (1 - at.y) / 2]; })()""")
    # The lens of three.js, brought from the canvas to the picture in it
    found = ((stage["x"] + column * stage["width"] - frame["x"]) / frame["width"] * 24,
             (stage["y"] + row * stage["height"] - frame["y"]) / frame["height"] * 20)
    view = page.evaluate("JSON.parse(document.getElementById('view').textContent)")
    camera = Pinhole.of(CameraPlan.model_validate(view["plan"]["camera"]), 24, 20)
    expected = camera.project(np.array([view["arrangement"]["target"]["centre"]]))[0, :2]
    np.testing.assert_allclose(found, expected, atol=0.15)
    before = page.evaluate(VIEWER)
    np.testing.assert_allclose(before, view["plan"]["camera"]["position"], atol=1e-4)


SMALL = {"small.yaml": FILES["small.yaml"].replace("[objects/ottoman.yaml]", "[objects/tiny.yaml]"),
         "objects/tiny.yaml": "file: ../tiny.obj\ncategory: crumb\nlicence: CC0-1.0\nscale: 0.001\nup: z\n",
         "tiny.obj": "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
         + "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"}
"""A cube of a millimetre."""
PICTURE = """(() => { const canvas = document.querySelector(".stage canvas"); arrangementScene.draw();
const copy = document.createElement("canvas"), to = copy.getContext("2d");
[copy.width, copy.height] = [canvas.width, canvas.height]; to.drawImage(canvas, 0, 0);
const found = new Set(), bytes = to.getImageData(0, 0, copy.width, copy.height).data;
for (let at = 0; at < bytes.length; at += 4) found.add(`${bytes[at]} ${bytes[at + 1]} ${bytes[at + 2]}`);
return found.size; })()"""
"""How many colours the stage shows."""


def test_a_millimetre_is_seen_through_its_camera_and_measured(page: "Page", tmp_path: Path) -> None:
    spec = write_spec(tmp_path / "specs", SMALL)
    assert main(["view", str(spec), "--example", "8", "--no-preview", "--out", str(tmp_path)]) == 0
    opened(page, tmp_path / "view.html")
    page.locator("summary", has_text="things").click()
    page.locator(".thing").first.click()
    assert "× 0.001 m" in page.locator(".side section").first.inner_text()
    page.get_by_role("button", name="Through the camera").click()
    shown = page.evaluate(PICTURE)
    page.evaluate("arrangementScene.groups.target.clear()")
    assert page.evaluate(PICTURE) < shown


def test_the_frame_of_the_picture_follows_the_window(page: "Page", written: Path) -> None:
    opened(page, written / "view.html")
    page.get_by_role("button", name="Through the camera").click()
    for size in ({"width": 1600, "height": 1000}, {"width": 700, "height": 600}, {"width": 1280, "height": 500}):
        page.set_viewport_size(size)
        frame, stage = (page.locator(each).bounding_box() for each in (".picture-frame", ".stage canvas"))
        assert frame is not None
        assert stage is not None
        assert frame["width"] / frame["height"] == pytest.approx(24 / 20, rel=0.01)
        assert min(stage["width"] - frame["width"], stage["height"] - frame["height"]) == pytest.approx(0, abs=1)


def test_names_have_distances_and_do_not_overlap(page: "Page", written: Path) -> None:
    opened(page, written / "view.html")
    view = page.evaluate("JSON.parse(document.getElementById('view').textContent)")
    away = np.linalg.norm(np.subtract(view["plan"]["camera"]["position"], view["arrangement"]["target"]["centre"]))
    assert page.locator(".name-tag", has_text="camera").inner_text() == f"camera, {away:.2f} m"
    for _ in range(6):
        boxes = [each.bounding_box() for each in page.locator(".name-tag:visible").all()]
        assert len(boxes) > 2
        for at, one in enumerate(boxes):
            for other in boxes[:at]:
                assert one is not None
                assert other is not None
                assert (one["x"] + one["width"] <= other["x"] + 1 or other["x"] + other["width"] <= one["x"] + 1
                        or one["y"] + one["height"] <= other["y"] + 1 or other["y"] + other["height"] <= one["y"] + 1)
        page.mouse.move(500, 500)
        page.mouse.down()
        page.mouse.move(570, 520, steps=2)
        page.mouse.up()


def test_names_are_no_html_and_a_preview_says_what_it_is(page: "Page", tmp_path: Path) -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    thing = StandingThing(name=HOSTILE, part="target", category=HOSTILE, positions=corners,
                          faces=np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]),
                          colours=np.full((4, 3), 90, np.uint8), clear=np.array([0, 0, 0, 1], bool))
    shown = ShownArrangement(key="", things=(thing, replace(thing, part="furniture")), lights=(), camera=None,
                             roof=np.inf)
    (tmp_path / "view.html").write_text(
        arrangement_page(shown, HOSTILE, None, QuickRender(missing=HOSTILE), [HOSTILE]), encoding="utf-8")
    opened(page, tmp_path / "view.html")
    assert page.locator("img").count() == 0
    assert page.locator("h1").inner_text() == HOSTILE
    assert HOSTILE in page.locator(".name-tag").first.inner_text()
    assert HOSTILE in page.get_by_role("alert").inner_text()
    assert page.get_by_role("button", name="Through the camera").count() == 0


def test_three_hundred_thousand_triangles_open(page: "Page", tmp_path: Path) -> None:
    side = 388
    x, y = (axis.ravel() for axis in np.mgrid[0:side, 0:side] / side * 4.0)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate([np.stack([corner, corner + side, corner + 1], 1),
                            np.stack([corner + 1, corner + side, corner + side + 1], 1)])
    hill = StandingThing(name="hill", part="target", category="hill", faces=faces, clear=np.zeros(len(faces), bool),
                         positions=np.stack([x, y, 0.3 * np.sin(3 * x) * np.cos(2 * y)], 1),
                         colours=np.tile(np.array([[120, 90, 60]], np.uint8), (len(faces), 1)))
    shown = ShownArrangement(key="", things=(hill,), lights=(), camera=None, roof=np.inf)
    text = arrangement_page(shown, "hill", None, QuickRender())
    (tmp_path / "view.html").write_text(text, encoding="utf-8")
    opened(page, tmp_path / "view.html")
    assert "299,538 triangles" in page.locator(".head").inner_text()
    assert page.evaluate(DARK) > 10000
    assert page.evaluate("arrangementScene.renderer.info.render.triangles") == len(faces)
