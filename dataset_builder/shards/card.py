"""The dataset's card: README.md with the YAML that Hugging Face needs, and the sections of a datasheet."""

import json
import re
from collections.abc import Iterable, Sequence

from dataset_builder.label.denoised_words import told_bias, told_relmse
from dataset_builder.shards.card_text import noise, pitfalls, plain, recipes
from dataset_builder.shards.manifest import STORED_ONCE, FieldSummary, Manifest

NUMBERED = "NNNNNN-TTTTTTTT.tar"
"""How the name of a shard ends, with its number and its tag; the first of a split need not have number 0."""
NAMED = 3
"""Objects of one source that are named; of the rest only how many there are."""
_MARKUP = re.compile(r"[\\`*_\[\]<>#&~]|^[-+=:]|^[0-9]+[.)](?= )")
_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))


def card(manifest: Manifest) -> str:
    """Text of README.md."""
    return "\n".join((_head(manifest), _composition(manifest), _generation(manifest), _use(manifest)))


def _head(manifest: Manifest) -> str:
    """`configs` is never left out: without it the Hub may take an index for the data."""
    return f"""---
{_licence(manifest.licence.lower())}
pretty_name: {json.dumps(manifest.title, ensure_ascii=False)}
tags: [webdataset, openexr, synthetic]
task_categories: [image-to-image]
size_categories: [{_size(manifest.totals.examples)}]
configs:
- config_name: default
  data_files:
{_data_files(manifest)}---

# {_plain(manifest.title)} {manifest.version}

{_plain(manifest.description) or "Image tuples for transferring light from clean to rough meshes of objects in rooms."}

## Motivation

Lighting transfer learns what a rough mesh of an object looks like under a light from what its clean mesh looks like.
Every example pairs both: one view of one object in one scene, under one change of light, at one noise level.
"""


def _composition(manifest: Manifest) -> str:
    return f"""## Composition

{manifest.totals.examples} examples of {manifest.width}x{manifest.height} pixels in {manifest.totals.shards} shards,
{manifest.totals.bytes} bytes.
{_subset(manifest)}
| split | examples | shards |
|---|---|---|
{_rows((split.name, split.examples, len(split.shards)) for split in manifest.splits)}{_in_common(manifest)}
Each example is a set of files with one key of eight digits: an EXR per layer, `.json` (its whole plan, what happened
while it was rendered, minimum, maximum and mean of every layer) and `.preview.png` (tone-mapped, for viewing only).
{_shared(manifest)}
| member | symbol | pixels | channels | type | range | unit | meaning |
|---|---|---|---|---|---|---|---|
{_rows((f"`.{layer.name}.exr`", layer.symbol, layer.extent, layer.channels, layer.dtype, layer.range, layer.unit,
        layer.meaning) for layer in manifest.layers)}
In plain words:

| layer | shows | noise |
|---|---|---|
{_rows((f"`{layer.name}`", plain(layer.name), noise(layer, manifest)) for layer in manifest.layers)}
Colours are linear, scene-referred Rec.709: no tone mapping, no gamma, no clipping. Lengths are metres, Z is up.
"""


def _shared(manifest: Manifest) -> str:
    return f"{STORED_ONCE}\n" if manifest.shared == "once" else ""


def _in_common(manifest: Manifest) -> str:
    """What splits share; empty where they share nothing."""
    return "".join(f"\n**{one.sentence[:1].upper()}{one.sentence[1:]}.**\n" for one in manifest.in_common)


def _subset(manifest: Manifest) -> str:
    """Which dataset the examples were chosen from; empty where from none."""
    if not (one := manifest.subset):
        return ""
    return f"""
This is a subset of {_plain(one.name)} {_plain(one.version)}, which has {one.examples} examples (SHA-256 of its
`dataset.json`: `{one.sha256}`). What was asked for: {_plain(one.choice)}. Keys and labels are as they are there, so
labels and previews also tell of layers that were left out, and figures over many examples are of all of its own.
"""


def _generation(manifest: Manifest) -> str:
    return f"""## Generation

{_made(manifest)}; generator {manifest.generator}. Every number of an example follows from its plan and every
plan from the spec and its seed: the same spec and versions give the same bytes. Spec digest `{manifest.spec_digest}`.

Every example keeps these rules; `dataset-builder verify` checks them again:

| rule | statement | tolerance |
|---|---|---|
{_rows((f"`{identity.name}`", identity.rule, f"{identity.tolerance:g}") for identity in manifest.identities)}
{_sources(manifest)}{_fields(manifest)}## Excluded examples

{_rejected(manifest)}"""


def _sources(manifest: Manifest) -> str:
    """What objects and scenes were made from, and under which licences; empty where that is not known."""
    if not manifest.parts:
        return ""
    kinds = {"file": "mesh file", "procedural": "embedded", "thing": "scene file"}
    rows = _rows((_plain(part.source), "capture" if part.captured else kinds[part.kind], part.licence,
                  _named(part.objects)) for part in manifest.parts)
    return f"""### Sources

| source | kind | licence | objects |
|---|---|---|---|
{rows}
"""


def _made(manifest: Manifest) -> str:
    return "By path tracing, with captures of real objects" if manifest.captures else "Synthetic, by path tracing"


def _fields(manifest: Manifest) -> str:
    """Where `i_s` and rough meshes come from, where that is not the clean mesh everywhere; else empty."""
    if not manifest.fields:
        return ""
    gives = {"i_s": "`i_s`", "r3dm": "rough meshes"}
    rows = _rows((one.split, one.kind + ", captured" * one.captures, " and ".join(gives[each] for each in one.gives),
                  one.fields, one.views or "", one.resolution or "", *_held_out(one))
                 for one in manifest.fields)
    return f"""### Fields

Where `i_s` is the image of a neural field (density: as NeRF has it; sdf: signed distance, as NeuS has it) or of
Gaussian splats, that was fitted to images of the object alone, and it shows the object alone. Where the rough mesh is a
field's, it was taken from it. All other `i_s` is rendered from clean meshes, and all other rough meshes are made of
these. Captures have no clean mesh, hence no truth. PSNR (dB, sRGB-encoded, inside of the mask) and intersection over
union (IoU) of opacity and mask are of held-out images; `record.field` of a label has the figures of its own field.

| split | field | gives | objects | views | cells | PSNR | worst image | least IoU |
|---|---|---|---|---|---|---|---|---|
{rows}
"""


def _held_out(one: FieldSummary) -> tuple[str, str, str]:
    return (f"{one.psnr:.1f}", f"{one.psnr_worst:.1f}", f"{one.opacity_iou:.3f}") if one.psnr else ("", "", "")


def _named(objects: Sequence[str]) -> str:
    more = len(objects) - NAMED
    return ", ".join(objects[:NAMED]) + (f" and {more} more" if more > 0 else "")


def _licence(name: str) -> str:
    """Lines of the head; the Hub knows no licences of one's own."""
    quoted = json.dumps(name, ensure_ascii=False)
    return f"license: other\nlicense_name: {quoted}" if name.startswith("licenseref-") else f"license: {quoted}"


def _denoised(manifest: Manifest) -> str:
    """What was denoised, and how far it may be trusted; empty where nothing was."""
    if not manifest.denoised:
        return ""
    return f"""## Denoised layers

These layers are not what the path tracer returned: they were denoised with Open Image Denoise and scaled to the mean
of the noisy layer. A standard error stored beside one is the noisy layer's. Measured over the object on a few
examples of this dataset, against converged references; a bias smaller than twice its error cannot be told from 0. Pixel
bias is the root mean square of the error that stays in each pixel without noise; where noise hides it, a bound.

| layer | bias of the mean | its error | pixel bias | relMSE noisy | relMSE denoised | of the reference | examples |
|---|---|---|---|---|---|---|---|
{_rows((f"`{item.layer}`", *told_bias(item), *told_relmse(item), str(item.examples)) for item in manifest.denoised)}
"""


def _use(manifest: Manifest) -> str:
    return f"""{_denoised(manifest)}## Known artefacts

{_bullets(pitfalls(manifest))}
## Reading

Shards are plain tar files after webdataset's rule. `dataset.json` lists them with sizes and SHA-256, `index/` says
where in a shard every file is, and `sha256sum -c SHA256SUMS` checks a download.

{recipes(manifest)}
## Maintenance

Version {manifest.version}: a new major version changes data, a new minor version adds some, a patch repacks the same.
Licence: {_plain(manifest.licence)}. Made by {_plain(manifest.creator)}.
"""


def _bullets(sentences: Iterable[str]) -> str:
    return "".join(f"- {sentence}\n" for sentence in sentences)


def _size(examples: int) -> str:
    return next((name for limit, name in _SIZES if examples < limit), "n>1M")


def _data_files(manifest: Manifest) -> str:
    lines = []
    for split in manifest.splits:
        if split.shards:
            pattern = split.shards[0][:-len(NUMBERED)] + "*.tar"
            lines.append(f"  - split: {split.name}\n    path: shards/{pattern}\n")
    return "".join(lines)


def _plain(text: str) -> str:
    """Text as one line of Markdown that shows it and nothing else: no markup, no HTML, no list, no rule."""
    return _MARKUP.sub(r"\\\g<0>", " ".join(text.split()))


def _rows(rows: Iterable[Sequence[object]]) -> str:
    return "".join("| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |\n" for row in rows)


def _rejected(manifest: Manifest) -> str:
    if not manifest.rejected:
        return "None: every planned example passed every gate.\n"
    head = ("These failed a gate and are not part of the dataset. Those whose gate is `planning` could not be "
            "planned, so that\nnothing was rendered.\n\n")
    return head + "| key | gate | reason |\n|---|---|---|\n" + _rows(
        (item.key, item.gate, _plain(item.reason)) for item in manifest.rejected)
