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
