"""Which layers a dataset holds, and on which pixels: a mapping, or a list of names."""

from typing import Annotated, Any, get_args

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from dataset_builder.layers import LAYERS, Extent
from dataset_builder.spec.model import broken
from dataset_builder.spec.problems import shown


def _known_layer(name: str) -> str:
    if name not in LAYERS:
        raise broken("expected a layer", known=tuple(LAYERS))
    return name


LayerName = Annotated[str, AfterValidator(_known_layer), Field(json_schema_extra={"enum": list(LAYERS)})]


def _by_name(value: Any) -> Any:
    """A list of layers as the mapping that it stands for: a name alone is stored on the object's pixels."""
    if not isinstance(value, (list, tuple)):
        return value
    found = dict[Any, Any]()
    for index, entry in enumerate(value):
        if not isinstance(entry, (str, dict)):
            raise broken(f"expected a layer, or one with its extent, such as {{i_t: frame}}, got {shown(entry)}",
                         path=(index,))
        for name, extent in (entry if isinstance(entry, dict) else {entry: "object"}).items():
            if name in found:
                raise broken(f"expected each layer once, got {name} again", path=(index,))
            found[name] = extent
    return found


_EXTENTS: dict[str, Any] = {"type": "object", "minProperties": 1, "propertyNames": {"enum": list(LAYERS)},
                            "additionalProperties": {"enum": list(get_args(Extent))}}
LayerExtents = Annotated[dict[LayerName, Extent], Field(min_length=1), BeforeValidator(_by_name), WithJsonSchema({
    "anyOf": [_EXTENTS, {"type": "array", "minItems": 1, "items": {"anyOf": [{"enum": list(LAYERS)}, _EXTENTS]}}]})]
"""The pixels on which each layer is stored."""
