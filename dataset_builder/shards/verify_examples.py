"""Verification of examples: names, decoding, digests, labels, identities, and agreement with each other."""

from collections.abc import Generator, Iterator, Mapping, Set
from pathlib import Path

import numpy as np

from dataset_builder.digest import pixel_digest, sha256_bytes
from dataset_builder.errors import Problem, ShardError
from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.shards import exr
from dataset_builder.shards.example import LABEL, PREVIEW, decode_png
from dataset_builder.shards.identities import Violation, check_layers, identity_table, shared_in_view
from dataset_builder.shards.label_text import (
    SCHEMA_VERSION,
    differences,
    encode_label,
    parse_label,
    read_label,
    statistics,
    structure,
)
from dataset_builder.shards.manifest import LayerRecord, Manifest
from dataset_builder.shards.shard_index import ExampleRecord, MemberRecord, ShardIndex
from dataset_builder.shards.structure import misplaced, read_member

MOST_SHOWN = 1000
"""Characters of a list of names."""


class ExampleChecks:
    """Checks the examples of one shard, one after the other, and remembers what must agree with other shards."""

    def __init__(self, manifest: Manifest, tar: Path, index: ShardIndex):
        self._manifest, self._tar, self._index = manifest, tar, index
        self._layers = {layer.name: layer for layer in manifest.layers}
        self._tolerances = {name: tolerance for name, _, tolerance in identity_table(manifest.layers[0].dtype, True)}
        self._extents = {layer.name: layer.extent for layer in manifest.layers}
        self._most_side = exr.most_side(manifest.width, manifest.height)
        self.views: dict[str, tuple[str, dict[str, str]]] = {}
        """Of every view its first example, and pixel digests of that one's layers by name."""
        self.label: tuple[str, dict[str, str]] | None = None
        """Key of the first example whose label can be read, and the structure of that label."""

    def listed(self) -> Iterator[Problem]:
        """What is wrong with examples as the index lists them: names of members, views that do not share layers."""
        for example in self._index.examples:
            yield from self._names(self._tar, example)
            yield from self._view(self._tar, example)

    def contents(self) -> Iterator[Problem]:
        """What is wrong with pixels and labels. Members whose place or bytes are not those of the index are not looked
        into: `structure.tar_problems` reports them."""
        skipped = misplaced(self._index)
        for example in self._index.examples:
            yield from self._content(self._tar, example, self._index.shard.split, skipped)

    def _names(self, tar: Path, example: ExampleRecord) -> Iterator[Problem]:
        suffixes = sorted([*(f"{name}.exr" for name in self._layers), LABEL, PREVIEW])
        names = [member.name for member in example.members]
        if [member.suffix for member in example.members] != suffixes:
            rule = f"expected members {', '.join(suffixes)}, got {str(names)[:MOST_SHOWN]}"
            yield Problem(where=tar.name, path=example.key, rule=rule)
        needed = suffixes if self._manifest.shared == "each" else [LABEL]
        if shared := [member.name for member in example.members
                      if member.key != example.key and member.suffix in needed]:
            rule = f"expected them in the shard under its own key, got {str(shared)[:MOST_SHOWN]}"
            yield Problem(where=tar.name, path=example.key, rule=rule)

    def _view(self, tar: Path, example: ExampleRecord) -> Iterator[Problem]:
        digests = {name: member.pixel_digest for name in self._layers
                   for member in example.members if member.suffix == f"{name}.exr"}
        first, shared = self.views.setdefault(example.view, (example.key, digests))
        for violation in shared_in_view(shared, digests):
            yield _violated(tar, f"{example.key} and {first}", violation)

    def _content(self, tar: Path, example: ExampleRecord, split: str, skipped: Set[str]) -> Iterator[Problem]:
        layers: dict[str, np.ndarray] = {}
        label = None
        # A preview has two pictures side by side
        most = 2 * self._most_side
        for member in (member for member in example.members if member.name not in skipped):
            suffix = member.suffix
            try:
                if (data := _undamaged(tar, member)) is None:
                    continue
                if suffix == LABEL:
                    label = yield from self._label(tar, example, split, data)
                elif suffix == PREVIEW:
                    yield from _digest(tar, member, decode_png(data, where=member.name, most=most))
                elif (layer := self._layers.get(suffix.removesuffix(".exr"))) is not None:
                    image = exr.read(data, where=member.name, most=self._most_side)
                    layers[layer.name] = pixels = image.pixels
                    yield from self._image(tar, member, image, pixels, layer)
            except ShardError as error:
                yield from error.problems
        yield from self._together(tar, example.key, layers, label)

    def _image(self, tar: Path, member: MemberRecord, image: exr.ExrImage, pixels: np.ndarray,
               layer: LayerRecord) -> Iterator[Problem]:
        got = (image.layer, image.key, image.dtype, pixels.shape)
        want = (layer.name, member.key, layer.dtype, (self._manifest.height, self._manifest.width, layer.channels))
        if got != want:
            yield Problem(where=tar.name, path=member.name, rule=f"expected layer, key, type, shape {want}, got {got}")
        yield from _digest(tar, member, pixels)

    def _label(self, tar: Path, example: ExampleRecord, split: str,
               data: bytes) -> Generator[Problem, None, ExampleLabel]:
        name = f"{example.key}.{LABEL}"
        plain = read_label(data, where=tar.name, name=name)
        if encode_label(plain) != data:
            yield Problem(where=tar.name, path=name, rule="expected canonical JSON: sorted keys, floats with a point")
        found = structure(plain)
        first, pattern = self.label = self.label or (example.key, found)
        for difference in differences(pattern, found):
            yield Problem(where=tar.name, path=name, rule=f"{difference}, unlike example {first}")
        label = parse_label(data, where=tar.name, name=name)
        got = (label.schema_version, label.key, label.split, label.plan.key, label.plan.view)
        if got != (want := (SCHEMA_VERSION, example.key, split, example.key, example.view)):
            yield Problem(where=tar.name, path=name, rule=f"expected (schema, key, split, key, view) {want}, got {got}")
        return label

    def _together(self, tar: Path, key: str, layers: Mapping[str, np.ndarray],
                  label: ExampleLabel | None) -> Iterator[Problem]:
        if len({array.shape[:2] for array in layers.values()}) == 1:
            seen = label is None or label.plan.field.there
            for violation in check_layers(layers, self._extents, self._tolerances, seen):
                yield _violated(tar, key, violation)
        if label is None:
            return
        for name, array in layers.items():
            # What is not finite has none, and breaks its range
            if np.isfinite(array).all() and (stated := label.layers.get(name)) != (found := statistics(array)):
                rule = f"expected the least, largest and mean value {found}, got {stated}"
                yield Problem(where=tar.name, path=f"{key}.{LABEL}: layers.{name}", rule=rule)


def _undamaged(tar: Path, member: MemberRecord) -> bytes | None:
    try:
        data = read_member(tar, member)
    except ShardError:
        return None
    return data if sha256_bytes(data) == member.sha256 else None


def _digest(tar: Path, member: MemberRecord, pixels: np.ndarray) -> Iterator[Problem]:
    if pixel_digest(pixels) != member.pixel_digest:
        yield Problem(where=tar.name, path=member.name, rule="expected pixels with the digest that the index gives")


def _violated(tar: Path, key: str, violation: Violation) -> Problem:
    return Problem(where=tar.name, path=f"{key}: {violation.identity}", rule=violation.reason)
