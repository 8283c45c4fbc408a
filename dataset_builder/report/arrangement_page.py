"""What `view` writes: the arrangement of an example as a picture and as a page, with a preview in both."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.report.decision_rows import decision_rows
from dataset_builder.report.example_sheet import INK, PALE, PAPER, png_of
from dataset_builder.report.front.fill_page import fill, script_json
from dataset_builder.report.front.pages import STYLES, VIEWER
from dataset_builder.report.gallery.example_payload import example_payload
from dataset_builder.report.looking.arrangement_data import arrangement_data
from dataset_builder.report.looking.arrangement_picture import above, through_camera
from dataset_builder.report.looking.shown_arrangement import ShownArrangement
from dataset_builder.report.quick_render import QuickRender
from dataset_builder.tonemap import exposure, to_8bit

WIDTH, HEIGHT, CELL, EDGE, LINE = 960, 720, 400, 12, 26
"""Pixels of the view from above, of a picture of the preview, and about them."""
SCRIPTS = ("vendor/three.js", *VIEWER, "scripts/name_tags.js", "scripts/arrangement.js", "scripts/view_page.js")


def arrangement_panels(shown: ShownArrangement) -> dict[str, np.ndarray]:
    """(H, W, 3) uint8 pictures by heading: from above, and through the camera where there is one."""
    panels = {"from above, near walls and roof cut away": above(shown, WIDTH, HEIGHT)}
    if shown.camera is not None:
        wide = min(WIDTH, round(HEIGHT * shown.camera.width / shown.camera.height))
        seen = through_camera(shown, wide)
        panels |= {"through the camera, colours without light": seen} if seen is not None else {}
    return panels


def preview_panels(preview: QuickRender) -> dict[str, np.ndarray]:
    """(H, W, 3) uint8 pictures by heading, layers under one exposure, their pixels as squares."""
    factor = exposure(list(preview.images.values()))
    return {f"{name}: {preview.note}": np.asarray(Image.fromarray(to_8bit(image, factor)).resize(
        (CELL, max(1, round(CELL * image.shape[0] / image.shape[1]))), Image.Resampling.NEAREST))
        for name, image in preview.images.items()}


def panels_png(title: str, *rows: dict[str, np.ndarray]) -> bytes:
    """A PNG of rows of pictures under their headings."""
    rows = tuple(row for row in rows if row)
    widths = [sum(panel.shape[1] + EDGE for panel in row.values()) + EDGE for row in rows]
    heights = [max(panel.shape[0] for panel in row.values()) + LINE for row in rows]
    page = Image.new("RGB", (max(widths), sum(heights) + EDGE * (len(rows) + 1) + LINE), PAPER)
    draw, top = ImageDraw.Draw(page), EDGE + LINE
    draw.text((EDGE, EDGE), title, fill=INK, font=ImageFont.load_default(17))
    for row, height in zip(rows, heights, strict=True):
        left = EDGE
        for heading, panel in row.items():
            draw.text((left, top + 4), heading, fill=PALE, font=ImageFont.load_default(13))
            page.paste(Image.fromarray(panel), (left, top + LINE))
            left += panel.shape[1] + EDGE
        top += height + EDGE
    return png_of(np.asarray(page))


def arrangement_page(shown: ShownArrangement, title: str, plan: ExamplePlan | None, preview: QuickRender,
                     problems: Sequence[str] = ()) -> str:
    """The page, in one file. plan: of the example, where it can be planned. problems: why it cannot."""
    payload = None
    dumped: dict[str, Any] = plan.model_dump(mode="json") if plan else {}
    if preview.images and plan:
        payload = example_payload({**preview.images, "meta": {"plan": dumped}}, key=plan.key,
                                  title="Preview: i_s, i_t and S'", note=preview.note)
    view = {"title": title, "badge": "before rendering", "said": _said(shown, plan), "problems": list(problems),
            "arrangement": arrangement_data(shown), "decisions": decision_rows(plan) if plan else [],
            "plan": dumped or None, "preview": payload,
            "unseen": f"Not in the preview: {preview.missing}." if preview.missing else ""}
    return fill("view.html", scripts=SCRIPTS, styles=(*STYLES, "styles/view_page.css"), title=title,
                view=script_json(view))


def _said(shown: ShownArrangement, plan: ExamplePlan | None) -> str:
    """What it is an arrangement of, in a line."""
    furniture = sum(thing.part == "furniture" for thing in shown.things)
    standing = f"{shown.target.name} ({shown.target.category}) among {furniture} other things"
    if plan is None:
        return f"{standing}, no camera"
    return (f"{standing} in {plan.room.name}, split {plan.split}, target light {plan.light}, noise level "
            f"{plan.rough.name or plan.rough.level}")
