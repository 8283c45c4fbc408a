"""`croissant.json`: the dataset in the Croissant 1.1 vocabulary (MLCommons), for catalogues and search engines.

One FileObject with its SHA-256 per shard; record sets of the splits, of the labels, whose fields are those of
`label.ExampleLabel`, and of each layer, keyed by example. The context is that of 1.1 in full: with another one readers
load the file without an error and find no records.
"""

import json
from collections.abc import Iterator
from typing import Any, Literal, cast, get_args, get_origin
from urllib.parse import quote

from dataset_builder.label.example_label import ExampleLabel, LayerStatistics
from dataset_builder.label.scene_plan import ObjectSource, Vector
from dataset_builder.shards.manifest import STORED_ONCE, LayerRecord, Manifest
from dataset_builder.spec.model import Model

CONFORMS_TO = "http://mlcommons.org/croissant/1.1"
KEY_PATTERN = r"([0-9]{8})\.[^/]+$"
SPLITS, LABEL = "splits", "label"
_TYPES = {str: "sc:Text", int: "sc:Integer", float: "sc:Float", bool: "sc:Boolean"}
_PLAIN = (
    "arrayShape", "citeAs", "column", "containedIn", "extract", "field", "fileObject", "fileProperty", "fileSet",
    "format", "includes", "isArray", "isLiveDataset", "jsonPath", "key", "md5", "parentField", "path", "recordSet",
    "references", "regex", "repeated", "replace", "samplingRate", "separator", "source", "subField", "transform",
)
_CONTEXT: dict[str, Any] = {
    "@language": "en", "@vocab": "https://schema.org/", "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/", "rai": "http://mlcommons.org/croissant/RAI/",
    "prov": "http://www.w3.org/ns/prov#", "dct": "http://purl.org/dc/terms/",
    "conformsTo": "dct:conformsTo", "data": {"@id": "cr:data", "@type": "@json"},
    "examples": {"@id": "cr:examples", "@type": "@json"}, "equivalentProperty": "cr:equivalentProperty",
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    **{name: f"cr:{name}" for name in _PLAIN},
}


def croissant(manifest: Manifest) -> str:
    """Text of croissant.json. `datePublished` is the manifest's own, never the day of the build."""
    document = {
        "@context": _CONTEXT, "@type": "sc:Dataset", "dct:conformsTo": CONFORMS_TO, "conformsTo": CONFORMS_TO,
        "name": manifest.name, "description": _description(manifest), "version": manifest.version,
        "license": _licence(manifest.licence), "url": manifest.url, "isBasedOn": [*map(_part, manifest.parts)],
        "creator": {"@type": "sc:Organization", "name": manifest.creator}, "datePublished": manifest.date_published,
        "citeAs": f"{manifest.title}, version {manifest.version}, {manifest.creator}",
        "keywords": ["synthetic", "lighting transfer", "rendering", "openexr", "webdataset"], "isLiveDataset": False,
        "rai:dataCollection": _collected(manifest),
        "prov:wasGeneratedBy": f"{manifest.generator}, spec {manifest.spec_digest}",
        **_derived(manifest),
        "distribution": [*map(_shard, manifest.shards), _file_set(manifest, LABEL, "json", "application/json"),
                         *(_file_set(manifest, layer.name, f"{layer.name}.exr", "image/x-exr")
                           for layer in manifest.layers)],
        "recordSet": [_splits(manifest), _labels(manifest), *map(_records, manifest.layers)],
    }
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _description(manifest: Manifest) -> str:
    text = manifest.description or manifest.title
    more = [STORED_ONCE] * (manifest.shared == "once")
    more += [f"{one.sentence[:1].upper()}{one.sentence[1:]}." for one in manifest.in_common]
    return " ".join([text, *more])


def _derived(manifest: Manifest) -> dict[str, str]:
    one = manifest.subset
    return {"prov:wasDerivedFrom": f"{one.name} {one.version}, dataset.json {one.sha256}: {one.choice}"} if one else {}


def _collected(manifest: Manifest) -> str:
    fields = (" Some of the images i_s are those of neural fields, fitted to such renderings." if any(
        not summary.captures and "i_s" in summary.gives for summary in manifest.fields) else "")
    if manifest.captures:
        return f"Path traced from procedural or licensed meshes and from captures of real objects.{fields}"
    return f"Synthetic: path traced from procedural or licensed meshes; no people, no photographs.{fields}"


def _shard(shard: Any) -> dict[str, Any]:
    return {"@type": "cr:FileObject", "@id": shard.name, "name": shard.name, "contentUrl": f"shards/{shard.name}",
            "contentSize": f"{shard.bytes} B", "encodingFormat": "application/x-tar", "sha256": shard.sha256}


def _part(part: ObjectSource) -> dict[str, Any]:
    return {"@type": "sc:CreativeWork", "name": part.source, "license": _licence(part.licence),
            "description": ": ".join(filter(None, [part.kind, ", ".join(part.objects)]))}


def _licence(name: str) -> str:
    """Its page at SPDX, where it has one."""
    return name if name.startswith("LicenseRef-") else f"https://spdx.org/licenses/{quote(name, safe='')}.html"


def _file_set(manifest: Manifest, name: str, suffix: str, encoding: str) -> dict[str, Any]:
    return {"@type": "cr:FileSet", "@id": f"{name}-files", "name": f"{name}-files", "encodingFormat": encoding,
            "containedIn": [{"@id": shard.name} for shard in manifest.shards], "includes": f"*.{suffix}"}


def _splits(manifest: Manifest) -> dict[str, Any]:
    return {**_record_set(SPLITS, "splits and how many examples each has", "name"), "dataType": "cr:Split",
            "field": [_field(SPLITS, "name", "sc:Text"), _field(SPLITS, "examples", "sc:Integer")],
            "data": split_rows(manifest)}


def split_rows(manifest: Manifest) -> list[dict[str, Any]]:
    """The records of the splits."""
    return [{f"{SPLITS}/name": split.name, f"{SPLITS}/examples": split.examples} for split in manifest.splits]


def _labels(manifest: Manifest) -> dict[str, Any]:
    """Every number, text and vector of the labels; lists whose length varies between examples are in the files only."""
    fields = [_field(LABEL, path.replace(".", "/"), kind, {"jsonPath": f"$.{path}"}, **array)
              for path, kind, array in _leaves(ExampleLabel, "", manifest)]
    split = next(field for field in fields if field["name"] == "split")
    split["references"] = {"field": {"@id": f"{SPLITS}/name"}}
    return {**_record_set(LABEL, "what each example was made from, and what was measured", "key"), "field": fields}


def _leaves(model: type[Model], path: str, manifest: Manifest) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Dotted path and type of each value below a model of labels, and its shape where it is an array."""
    for name, field in model.model_fields.items():
        kind, below = cast(Any, field.annotation), f"{path}{name}"
        if isinstance(kind, type) and issubclass(kind, Model):
            yield from _leaves(kind, f"{below}.", manifest)
        elif kind in _TYPES or get_origin(kind) is Literal:
            yield below, _TYPES.get(kind, "sc:Text"), {}
        elif kind == Vector:
            yield below, "sc:Float", {"isArray": True, "arrayShape": "3"}
        elif kind == tuple[Vector, ...]:
            yield below, "sc:Float", {"isArray": True, "arrayShape": "-1,3"}
        elif get_args(kind)[-1:] == (LayerStatistics,):
            for layer in manifest.layers:
                yield from _leaves(LayerStatistics, f"{below}.{layer.name}.", manifest)


def _records(layer: LayerRecord) -> dict[str, Any]:
    """The pixels are an image; readers that know 8-bit formats only must decode the EXR themselves."""
    key = _field(layer.name, "key", "sc:Text", {"fileProperty": "filename"})
    key["source"]["transform"] = {"regex": KEY_PATTERN}
    return {**_record_set(layer.name, layer.meaning, "key"),
            "field": [key, _field(layer.name, "content", "sc:ImageObject", {"fileProperty": "content"})]}


def _record_set(name: str, description: str, key: str) -> dict[str, Any]:
    return {"@type": "cr:RecordSet", "@id": name, "name": name, "description": description,
            "key": {"@id": f"{name}/{key}"}}


def _field(record_set: str, name: str, kind: str, extract: dict[str, str] | None = None,
           **more: Any) -> dict[str, Any]:
    """A field; what it is extracted from are the files that the record set is named after."""
    source = {"source": {"fileSet": {"@id": f"{record_set}-files"}, "extract": extract}} if extract else {}
    return {"@type": "cr:Field", "@id": f"{record_set}/{name}", "name": name, "dataType": kind, **source, **more}
