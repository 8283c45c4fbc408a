"""A page of HTML from a template, with its styles, scripts and data inside, so that it works wherever it is opened."""

import json
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment

HERE = Path(__file__).parent


def fill(template: str, *, scripts: Sequence[str] = (), styles: Sequence[str] = (), **values: Any) -> str:
    """The page that a template of `templates/` gives; what `values` hold is escaped.

    scripts, styles: files of this folder, such as `vendor/vue.js`, which the template finds as text in the
    lists `scripts` and `styles`.
    """
    texts = {name: [(HERE / file).read_text(encoding="utf-8") for file in files]
             for name, files in (("scripts", scripts), ("styles", styles))}
    return _templates().get_template(template).render(**texts, **values)


def script_json(value: Mapping[str, Any] | Sequence[Any]) -> str:
    """Plain data as JSON that may stand in a script: no text in it ends the script, NaN and Inf are refused."""
    text = json.dumps(value, allow_nan=False, ensure_ascii=True, separators=(",", ":"))
    return text.replace("<", "\\u003c")


@cache
def _templates() -> "Environment":
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(loader=FileSystemLoader(HERE / "templates"), autoescape=True, undefined=StrictUndefined,
                       trim_blocks=True, lstrip_blocks=True)
