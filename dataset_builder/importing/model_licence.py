"""The licence of a model as its file or a file beside it says; never guessed."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dataset_builder.digest import read_regular
from dataset_builder.importing.find_models import FoundModel
from dataset_builder.spec.gltf_references import read_container

MOST_BYTES = 2**22
SHORTEST = 4
"""Letters of a first word that may name a model."""
NAMES = ("license", "licence", "copying", "readme")
"""How names of text files that may tell begin, whatever their capitals."""
KEYS = ("license", "licence", "spdx", "spdx_id", "spdx-id", "copyright")
_TAGGED = re.compile(r"SPDX-License-Identifier:\s*([A-Za-z0-9.+-]+)")
_WHOLE = re.compile(r"(?=.*\d)[A-Za-z][A-Za-z0-9.+-]*|LicenseRef-[A-Za-z0-9.-]+")
_COMMONS = re.compile(r"CC[- ](BY(?:[- ]NC)?(?:[- ](?:SA|ND))?)[- ]v?([1-4]\.[05])|"
                      r"creativecommons\.org/licenses/(by(?:-nc)?(?:-(?:sa|nd))?)/([1-4]\.[05])", re.IGNORECASE)
_TITLE = re.compile(r"Attribution(-Non-?Commercial)?(-Share-?Alike|-No-?Deriv\w*)? ([1-4]\.[05])", re.IGNORECASE)
_NAMED = {
    "CC0-1.0": r"\bCC0\b|publicdomain/zero/1\.0|Creative Commons Zero",
    "MIT-0": r"\bMIT-0\b|MIT No Attribution", "MIT": r"\bMIT\b(?!-0| No Attribution)",
    "Apache-2.0": r"\bApache-2\.0\b|Apache License,?\s+Version 2\.0",
    "BSD-2-Clause": r"\bBSD-2-Clause\b", "BSD-3-Clause": r"\bBSD-3-Clause\b", "0BSD": r"\b0BSD\b",
    "Unlicense": r"\bunlicense\.org\b|\bUnlicense\b", "ODbL-1.0": r"\bODbL-1\.0\b",
    "GPL-3.0-only": r"\bGPL-3\.0-only\b", "GPL-3.0-or-later": r"\bGPL-3\.0-or-later\b",
}


@dataclass(frozen=True, kw_only=True)
class FoundLicence:
    """What is known of a model's licence."""

    spdx: str = ""
    """Empty where nothing says one, or something says several."""
    source: str = ""
    """Who says so, for people: `LICENSE.txt`; or why none was taken."""


def licences_in(text: str) -> list[str]:
    """SPDX identifiers of the licences that a text names, each once; a CC licence needs its version.

    >>> licences_in("CC BY-NC 4.0, see creativecommons.org/licenses/by-nc/4.0"), licences_in("CC BY")
    (['CC-BY-NC-4.0'], [])
    """
    if tagged := _TAGGED.findall(text):
        return list(dict.fromkeys(tagged))
    found = [f"CC-{(a or c).upper().replace(' ', '-')}-{b or d}" for a, b, c, d in _COMMONS.findall(text)]
    for commercial, share, version in _TITLE.findall(text):
        kind = "-ND" if "deriv" in share.lower() else "-SA" * bool(share)
        found.append(f"CC-BY{'-NC' * bool(commercial)}{kind}-{version}")
    found += [spdx for spdx, pattern in _NAMED.items() if re.search(pattern, text, re.IGNORECASE)]
    return list(dict.fromkeys(found))


def licence_of_model(model: FoundModel) -> FoundLicence:
    """What the nearest source says that says anything: a sidecar `NAME.license.json`, the glTF file itself, then folder
    by folder up to the root `LICENSE*`, `LICENCE*`, `COPYING*`, `README*` and `model_info.json`.

    Of a text that names several, only lines about this model count. A source that stays ambiguous ends the search.
    """
    for source, texts in _sources(model):
        found = list(dict.fromkeys(spdx for text in texts for spdx in _own(text)))
        if len(found) == 1:
            return FoundLicence(spdx=found[0], source=source)
        if found:
            return FoundLicence(source=f"{source} names several: {', '.join(found)}")
    return FoundLicence()


def _own(text: str) -> list[str]:
    return [text] if _WHOLE.fullmatch(text.strip()) else licences_in(text)


def _sources(model: FoundModel) -> Iterator[tuple[str, list[str]]]:
    """Names of sources, nearest first, and what each says."""
    for ending in (".license.json", ".licence.json"):
        yield f"{model.path.stem}{ending}", _said(_json(model.path.with_name(model.path.stem + ending)))
    if model.path.suffix.lower() in (".glb", ".gltf"):
        yield model.path.name, _of_gltf(model.path)
    for folder in model.folders:
        for path in (path for start in NAMES for path in _starting(folder, start)):
            yield path.name, _of_text(path, model, folder)
        yield "model_info.json", _said(info_of(model, folder))


def _starting(folder: Path, start: str) -> list[Path]:
    """Files of a folder by the beginning of their names, whatever its capitals."""
    return sorted(path for path in folder.iterdir() if path.name.lower().startswith(start) and path.is_file()
                  and path.suffix.lower() in ("", ".txt", ".md", ".rst"))


def _of_text(path: Path, model: FoundModel, folder: Path) -> list[str]:
    """The text of a licence or the lines of a README that speak of one; of several licences, lines about the model."""
    try:
        text = read_regular(path, most=MOST_BYTES).decode("utf-8", errors="replace")
    except (OSError, ValueError):
        return []
    if path.name.lower().startswith("readme"):
        text = "\n".join(line for line in text.splitlines() if re.search("licen[cs]e|spdx", line, re.IGNORECASE))
    if len(licences_in(text)) > 1:
        own = {model.path.stem, model.title, *(part.name for part in model.folders if part != folder)}
        lines = [line for line in text.splitlines() if own & set(_entries(line))]
        text = "\n".join(lines) if licences_in("\n".join(lines)) else text
    return [text]


def _entries(line: str) -> Iterator[str]:
    """What a line of a list or a table may be about: its cells, their first words, and the parts of paths in these. A
    word within a sentence is none, as folders have names such as `a`, too."""
    for cell in re.split(r"[|,;:`\"'*()\[\]\t]", line):
        name = cell.strip(" -+/")
        first = name.partition(" ")[0]
        for path in (Path(name), Path(first if len(first) >= SHORTEST else name)):
            yield from (*path.parts, path.stem)


def _of_gltf(path: Path) -> list[str]:
    try:
        asset = read_container(path).header.get("asset")
    except (OSError, ValueError):
        return []
    asset = asset if isinstance(asset, dict) else {}
    return [*_said(asset.get("extras")), *_said(asset)]


def info_of(model: FoundModel, folder: Path) -> Any:
    """The model's entry in a `model_info.json` as 3D-FUTURE has it, a list of objects with a `model_id`, or None."""
    entries = _json(folder / "model_info.json")
    names = {model.path.stem, *(part.name for part in model.folders)}
    return next((entry for entry in entries if isinstance(entry, dict) and entry.get("model_id") in names), None) \
        if isinstance(entries, list) else None


def _said(data: Any) -> list[str]:
    return [data[key] for key in KEYS if isinstance(data.get(key), str)] if isinstance(data, dict) else []


def _json(path: Path) -> Any:
    try:
        return json.loads(read_regular(path, most=2**26)) if path.is_file() else None
    except (OSError, ValueError, RecursionError):
        return None
