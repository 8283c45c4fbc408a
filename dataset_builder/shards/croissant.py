"""`croissant.json`: the dataset in the Croissant 1.1 vocabulary (MLCommons), for catalogues and search engines.

One FileObject with its SHA-256 per shard; one FileSet and one record set, keyed by example, per layer. The context
is that of 1.1 in full: with another one readers load the file without an error and find no records.
"""

import json
from typing import Any
from urllib.parse import quote

from dataset_builder.shards.manifest import LayerRecord, Manifest

CONFORMS_TO = "http://mlcommons.org/croissant/1.1"
KEY_PATTERN = r"([0-9]{8})\.[^/]+$"
_PLAIN = (
    "citeAs", "column", "containedIn", "extract", "field", "fileObject", "fileProperty", "fileSet", "format",
    "includes", "isLiveDataset", "jsonPath", "key", "md5", "parentField", "path", "recordSet", "references", "regex",
    "repeated", "replace", "samplingRate", "separator", "source", "subField", "transform",
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
        "name": manifest.name, "description": manifest.description or manifest.title, "version": manifest.version,
        "license": f"https://spdx.org/licenses/{quote(manifest.licence, safe='')}.html", "url": manifest.url,
        "creator": {"@type": "sc:Organization", "name": manifest.creator}, "datePublished": manifest.date_published,
        "citeAs": f"{manifest.title}, version {manifest.version}, {manifest.creator}",
        "keywords": ["synthetic", "lighting transfer", "rendering", "openexr", "webdataset"], "isLiveDataset": False,
        "rai:dataCollection": "Synthetic: path traced from procedural or licensed meshes; no people, no photographs.",
        "prov:wasGeneratedBy": f"{manifest.generator}, spec {manifest.spec_digest}",
        "distribution": [*map(_shard, manifest.shards), *(_file_set(manifest, layer) for layer in manifest.layers)],
        "recordSet": [_records(layer) for layer in manifest.layers],
    }
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _shard(shard: Any) -> dict[str, Any]:
    return {"@type": "cr:FileObject", "@id": shard.name, "name": shard.name, "contentUrl": f"shards/{shard.name}",
            "contentSize": f"{shard.bytes} B", "encodingFormat": "application/x-tar", "sha256": shard.sha256}


def _file_set(manifest: Manifest, layer: LayerRecord) -> dict[str, Any]:
    return {"@type": "cr:FileSet", "@id": f"{layer.name}-files", "name": f"{layer.name}-files",
            "description": layer.meaning, "containedIn": [{"@id": shard.name} for shard in manifest.shards],
            "encodingFormat": "image/x-exr", "includes": f"*.{layer.name}.exr"}


def _records(layer: LayerRecord) -> dict[str, Any]:
    files = {"fileSet": {"@id": f"{layer.name}-files"}}
    key = {"@type": "cr:Field", "@id": f"{layer.name}/key", "name": "key", "dataType": "sc:Text",
           "description": "key of the example, the same in the record sets of all layers",
           "source": {**files, "extract": {"fileProperty": "filename"}, "transform": {"regex": KEY_PATTERN}}}
    # sc:Text hands out the bytes of the EXR; readers of sc:ImageObject open 8-bit formats only
    pixels = {"@type": "cr:Field", "@id": f"{layer.name}/content", "name": "content", "description": layer.meaning,
              "dataType": "sc:Text", "source": {**files, "extract": {"fileProperty": "content"}}}
    return {"@type": "cr:RecordSet", "@id": layer.name, "name": layer.name, "description": layer.meaning,
            "key": {"@id": f"{layer.name}/key"}, "field": [key, pixels]}
