"""Write the tables of `docs/specs.md` and `docs/label.md` from the models; a test keeps them in step."""

import inspect
import json
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin

from pydantic import AfterValidator, Discriminator
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.label.example_plan import RenderPlan
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.model import Model
from dataset_builder.spec.numbers import TAG
from dataset_builder.spec.problems import shown
from dataset_builder.spec.rough import RoughSpec
from dataset_builder.spec.scene import ObjectSpec, RoomSpec, SceneSpec

DOCS = Path(__file__).resolve().parent.parent / "docs"
START, END = "<!-- tables: made by tools/spec_tables.py -->", "<!-- end of tables -->"
PLAIN = {int: "whole number", float: "number", str: "text", bool: "true or false"}
BY_HAND = {
    (DatasetSpec, "layers"): ("a mapping of layers to `object` or `frame`, or a list of layers",
                              "the paper's six, each `object`"),
    (RoughSpec, "sigma"): ("number or distribution, >= 0, or a list of them", "`0.004`"),
    (RoughSpec, "level"): ("`smooth`, `light`, `medium`, `heavy` or `extreme`, or a list of them", "none"),
    (ExampleLabel, "layers"): ("a mapping of layers to mappings, below", ""),
    (RenderPlan, "layers"): ("list of pairs: a layer, and `object` or `frame`", ""),
}
"""Value and default of keys whose type says less than a sentence."""


@dataclass(frozen=True, kw_only=True)
class TablePage:
    """A page with tables: models by the title of their section. defaults: whether keys may be left out."""

    name: str
    kinds: Mapping[str, type[Model]]
    defaults: bool

    @property
    def path(self) -> Path:
        """Where it lies."""
        return DOCS / self.name

    def sections(self) -> Iterator[tuple[str, type[Model]]]:
        """Heading and model of every table, in reading order; a model that several keys hold has one table, and no two
        headings are the same."""
        headings = set[str]()
        for title, model in self.kinds.items():
            yield f"## {title}", model
            paths: dict[type[Model], list[str]] = {}
            for path, inner in nested(model, ""):
                paths.setdefault(inner, []).append(f"`{path}`")
            for inner, found in paths.items():
                kinds = get_args(inner.model_fields["kind"].annotation) if "kind" in inner.model_fields else ()
                kind = f", kind `{kinds[0]}`" if len(kinds) == 1 else ""
                heading = f"### {', '.join(found)}{kind}"
                yield f"{heading} of {title.lower()}" if heading in headings else heading, inner
                headings.add(heading)

    def tables(self) -> str:
        """Everything between the two marks."""
        columns = ["key", "value", *(["default"] if self.defaults else []), "meaning"]
        head = f"| {' | '.join(columns)} |\n|{' --- |' * len(columns)}\n"
        parts = [f"{heading}\n\n{inspect.getdoc(model)}\n\n{head}{rows(model, defaults=self.defaults)}"
                 for heading, model in self.sections()]
        return "\n" + "\n".join(parts) + "\n"

    def renewed(self) -> str:
        """The page with its tables made anew."""
        before, rest = self.path.read_text(encoding="utf-8").split(START)
        return before + START + self.tables() + END + rest.split(END)[1]


PAGES = (
    TablePage(name="specs.md", defaults=True, kinds={
        "Dataset files": DatasetSpec, "Scene files": SceneSpec, "Room files": RoomSpec, "Object files": ObjectSpec,
        "Training files": TrainingSpec}),
    TablePage(name="label.md", defaults=False, kinds={"The label": ExampleLabel}),
)


def nested(model: type[Model], path: str) -> Iterator[tuple[str, type[Model]]]:
    """Models below a model, depth first, with the dotted path of the key that holds them."""
    for name, field in model.model_fields.items():
        for inner, many in models_in(field.annotation, many=False):
            below = f"{path}{field.alias or name}{'[]' if many else ''}"
            yield below, inner
            yield from nested(inner, f"{below}.")


def models_in(annotation: Any, *, many: bool) -> Iterator[tuple[type[Model], bool]]:
    """Models that an annotation holds, and whether in a list; distributions of numbers are none."""
    if isinstance(annotation, type) and issubclass(annotation, Model):
        yield annotation, many
    elif not is_number(annotation):
        for part in get_args(annotation):
            if part not in (None, Ellipsis) and not isinstance(part, (str, int, float)):
                yield from models_in(part, many=many or get_origin(annotation) is tuple)


def is_number(annotation: Any) -> bool:
    """Whether an annotation is the union of a number and its distributions."""
    names = [getattr(item, "tag", "") for part in get_args(annotation) for item in getattr(part, "__metadata__", ())]
    return f"{TAG}uniform" in names


def rows(model: type[Model], *, defaults: bool) -> str:
    """The rows of one table."""
    lines = []
    for name, field in model.model_fields.items():
        value, default = BY_HAND.get((model, name)) or (value_of(field.annotation, field.metadata), default_of(field))
        meaning = " ".join((field.description or "").split())
        cells = [f"`{field.alias or name}`", value, *([default] if defaults else []), meaning]
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |\n")
    return "".join(lines)


def value_of(annotation: Any, metadata: Any = ()) -> str:
    """What may stand there, with its limits."""
    text, limits = kind_of(annotation), limits_of(metadata)
    return f"{text}, {limits}" if limits else text


def kind_of(annotation: Any) -> str:
    """What may stand there, in words."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if annotation in PLAIN:
        return PLAIN[annotation]
    if isinstance(annotation, type) and issubclass(annotation, Model):
        return "mapping, below"
    if hasattr(annotation, "__metadata__"):
        return value_of(parts[0], annotation.__metadata__)
    if origin is Literal:
        return " or ".join(f"`{part}`" for part in parts)
    if is_number(annotation):
        return "number or distribution"
    if origin in (Union, types.UnionType):
        return " or ".join(dict.fromkeys(kind_of(part) for part in parts if part is not type(None)))
    if parts in ((float, float), (float, float, float)):
        return f"{'two' if len(parts) == 2 else 'three'} numbers"
    if origin is tuple and Ellipsis not in parts:
        return f"{len(parts)} of: {kind_of(parts[0])}"
    if origin is tuple:
        return "list of mappings, below" if kind_of(parts[0]) == "mapping, below" else f"list of {kind_of(parts[0])}"
    if origin is dict:
        return f"mapping of {kind_of(parts[0])} to {kind_of(parts[1])}"
    raise TypeError(f"no words for {annotation!r}")


def limits_of(metadata: Any) -> str:
    """Limits that metadata states: pydantic's own, or the bounds of our validators."""
    low, high, strict = None, None, False
    for item in metadata:
        if isinstance(item, AfterValidator):
            bounds = inspect.getclosurevars(item.func).nonlocals
            low, high = bounds.get("low", low), bounds.get("high", high)
        elif not isinstance(item, Discriminator):
            for part in getattr(item, "metadata", [item]):
                low, high = getattr(part, "ge", low), getattr(part, "le", high)
                if hasattr(part, "gt"):
                    low, strict = part.gt, True
                if getattr(part, "lt", None) == 2**64:
                    high = "2^64 - 1"
    low, high = (None if bound in (float("-inf"), float("inf")) else bound for bound in (low, high))
    if low is not None and high is not None:
        return f"{plain(low)} to {plain(high)}"
    if low is not None:
        return f"{'>' if strict else '>='} {plain(low)}"
    return f"<= {plain(high)}" if high is not None else ""


def default_of(field: FieldInfo) -> str:
    """The default as it would be written."""
    if field.default is PydanticUndefined:
        return "required"
    if isinstance(field.default, Model):
        return f"`{shown(field.default.model_dump())}`" if is_number(field.annotation) else "its defaults"
    if field.default in (None, "", (), {}):
        return "none"
    return f"`{plain(field.default)}`"


def plain(value: Any) -> str:
    """YAML of a constant on one line."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(plain, value))}]"
    if isinstance(value, float):
        return f"{value:g}"
    return value if isinstance(value, str) else json.dumps(value)


if __name__ == "__main__":
    for page in PAGES:
        page.path.write_text(page.renewed(), encoding="utf-8")
