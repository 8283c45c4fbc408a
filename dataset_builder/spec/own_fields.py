"""Objects that are fields already, such as captures: what a spec cannot ask of them, since there is no clean mesh."""

from collections.abc import Iterator, Mapping

from dataset_builder.errors import Problem
from dataset_builder.layers import LAYERS
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.document import Document
from dataset_builder.spec.mesh_source import SCALED_FIELD, names_field
from dataset_builder.spec.scene import ObjectSpec

SHOWN_ALONE = ("source", "empty")
"""Passes that do not show the clean mesh where the target is a field."""
TO_HAVE = tuple(name for name, layer in LAYERS.items() if layer.geometry != "3dm" or layer.render_pass in SHOWN_ALONE)
"""Layers that need no clean mesh: what can be had of a target that is a field already."""


def is_field(spec: ObjectSpec | None) -> bool:
    """Whether an object is a field already."""
    return spec is not None and spec.file is not None and names_field(spec.file)


def has_fields(dataset: DatasetSpec, objects: Mapping[str, ObjectSpec]) -> bool:
    """Whether targets of a dataset are seen through fields, or their rough meshes taken from them."""
    return bool(dataset.rough.fields) or any(
        split.source.kind == "field" or any(is_field(objects.get(key)) for key in split.objects.source)
        for split in dataset.splits)


def check_own_field(spec: ObjectSpec, document: Document) -> Iterator[Problem]:
    """What is wrong with the object spec of a field: its frame and its unit are its own."""
    if is_field(spec):
        for key in sorted({"scale", "up"} & spec.model_fields_set):
            rule = f"expected no `{key}` beside a field, which has metres and stands already"
            yield document.problem((key,), rule, SCALED_FIELD)


def check_own_targets(dataset: DatasetSpec, document: Document,
                      objects: Mapping[str, ObjectSpec]) -> Iterator[Problem]:
    """What a dataset asks for that no field can give, where targets are fields: one problem for all layers."""
    owners = {split.name: [key for key in split.objects.source if is_field(objects.get(key))]
              for split in dataset.splits}
    if not (named := [f"{key} (split {name})" for name, keys in owners.items() for key in keys]):
        return
    who = named[0] + (f" and {len(named) - 1} more" if len(named) > 1 else "")
    if lost := [name for name in dataset.layers if name not in TO_HAVE]:
        rule = f"expected layers that need no clean mesh, since {who} is a field, got {', '.join(lost)}"
        yield document.problem(("layers",), rule, "there are " + ", ".join(
            name for name in TO_HAVE if not LAYERS[name].of) + ", and their standard errors")
    if dataset.layers.get("i_s") == "frame":
        rule = f"expected object, since {who} is a field, seen alone, got frame"
        yield document.problem(("layers", "i_s"), rule)
    if "i_s" in dataset.render.denoise.layers:
        yield document.problem(("render", "denoise", "layers"), f"expected no i_s, which is the image of {who}")
    for number, split in enumerate(dataset.splits):
        if owners[split.name] and (count := len(split.levels(dataset.rough))) > 1:
            rule = (f"expected one level, since the rough mesh of {owners[split.name][0]} is its own, got {count} "
                    "levels, which would be equal")
            yield document.problem(("rough",), rule)
        if split.source.kind == "field" and owners[split.name] == list(split.objects.source):
            rule = f"expected kind mesh, since every object of split {split.name} is a field already, got field"
            yield document.problem(("splits", number, "source", "kind"), rule)
        for index, key in enumerate(split.objects.source):
            if is_field(objects.get(key)) and objects[key].materials:
                rule = (f"expected no `materials` of {key} as a target, since its image would not follow, got "
                        f"{', '.join(objects[key].materials)}")
                yield document.problem(("splits", number, "objects", "from", index), rule,
                                       "as furniture it may have them")
