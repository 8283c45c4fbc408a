"""The pages that show examples: one or several on a page of their own, and the gallery of a dataset."""

from collections.abc import Mapping, Sequence
from typing import Any

from dataset_builder.report.front.fill_page import fill, script_json

STYLES = ("styles/page.css", "styles/layer_view.css")
VIEWER = ("vendor/vue.js", "scripts/layers.js", "scripts/label_tree.js", "scripts/layer_picture.js",
          "scripts/layer_view.js")
"""Scripts that define `LayerView`, the component that shows the layers of one example."""


def examples_page(title: str, payloads: Sequence[Mapping[str, Any]], lead: Sequence[str] = ()) -> str:
    """A page that shows the layers of examples, by tabs where there are several. lead: paragraphs on top."""
    return fill("example.html", scripts=(*VIEWER, "scripts/example_page.js"), styles=STYLES, title=title, lead=lead,
                examples=script_json(payloads))


def gallery_page(gallery: Mapping[str, Any], payloads: str = "") -> str:
    """The gallery of a dataset. payloads: `<script type="application/json" data-key="KEY">` elements with what
    `script_json` gives of each payload, for a page that holds them; else `gallery["base"]` is the folder of scripts
    that do, one `galleryExample(PAYLOAD);` each.
    """
    scripts = (*VIEWER, *(f"scripts/{name}.js" for name in ("gallery_facts", "histogram", "thumb_grid", "gallery")))
    return fill("gallery.html", scripts=scripts, styles=(*STYLES, "styles/gallery.css"), title=gallery["title"],
                gallery=script_json(gallery), payloads=payloads)
