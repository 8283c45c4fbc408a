"""The input of compose: the pictures of one camera, from an example of a dataset or from your own files."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dataset_builder.errors import Problem, UserError
from dataset_builder.lightnet.data.assemble import lighting_of
from dataset_builder.shards import exr
from dataset_builder.shards.reader import Dataset, load_manifest, open_dataset

NEEDED = ("i_s", "s_prime")
MASKS = ("mask", "mask_field", "mask_rough")
"""Layers that say M, the first that a dataset has."""
FRAMES = ("i_pbr", "i_t")
"""Layers that show the scene with something in the object's place, the first that a dataset has on the frame."""
EMPTY, ROUGH = "i_t_empty", "mask_rough"
"""Read where a dataset has them."""
PARTS = {"i_s": 3, "s_prime": 3, "mask": 1, "background": 3, "empty": 3, "mask_rough": 1}
"""Pictures of a frame, and their channels."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ComposeInput:
    """Linear, scene-referred (H, W, C) float32 pictures of one camera."""

    name: str
    i_s: np.ndarray
    """The object under plain light."""
    s_prime: np.ndarray
    """Raw lighting of its rough mesh in the scene."""
    mask: np.ndarray
    """Share of the pixel that the object covers."""
    background: np.ndarray | None = None
    """The whole scene, I_PBR."""
    empty: np.ndarray | None = None
    """The scene without the object; there is this, or the background, or both."""
    mask_rough: np.ndarray | None = None
    """The mask of the rough mesh, if it is known."""
    lighting: np.ndarray | None = None
    """(3, 9), see `data.assemble.lighting_of`."""
    files: Mapping[str, Path] = field(default_factory=dict)
    """Sources of the parts by name, for messages."""

    def __post_init__(self) -> None:
        """Raises UserError with all that is wrong: sizes, values that are not finite, masks beyond [0, 1], no scene."""
        parts = {name: getattr(self, name) for name in PARTS if getattr(self, name) is not None}
        if problems := [self._problem(name, rule) for name, part in parts.items()
                        if (rule := _broken(name, part, self.i_s.shape[:2]))]:
            raise UserError(problems)
        if self.background is None and self.empty is None:
            raise UserError([self._problem("background", "expected a frame of the scene, got none")])

    def _problem(self, name: str, rule: str) -> Problem:
        if name in self.files:
            return Problem(where=str(self.files[name]), path="", rule=rule)
        return Problem(where=self.name, path=name, rule=rule)


def input_from_files(paths: Mapping[str, Path]) -> ComposeInput:
    """The frame of EXR files by part, as many as there are. Raises UserError where one does not read or fit.

    Colours need the channels R, G, B; a mask has Y, or R, G, B that are all the same.
    """
    parts = {name: _read(path) for name, path in paths.items()}
    masks = {name: part[..., :1] for name, part in parts.items() if PARTS[name] == 1}
    if coloured := [name for name in masks if np.any(parts[name] != masks[name])]:
        rule = "expected a mask, one channel Y or three that are the same, got colours"
        raise UserError([Problem(where=str(paths[name]), path="", rule=rule) for name in coloured])
    return ComposeInput(name=str(paths["i_s"]), files=paths, **{**parts, **masks})


def input_from_dataset(folder: Path, *, key: str = "", split: str = "", index: int = 0) -> ComposeInput:
    """The frame of an example, by its key, or by its place in a split: I_PBR is its `i_pbr`, or else its `i_t`.

    The latter shows the clean mesh where the paper's I_PBR shows the rough one; around the object the two differ by its
    shadow's outline alone. Captures have no `i_t`. Raises UserError where there is no such example, or where layers are
    missing or none shows the scene around the object.
    """
    parts = _layers_of_parts(folder)
    dataset = open_dataset(folder, layers=list(dict.fromkeys(parts.values())))
    chosen = _key(dataset, folder, key, split, index)
    example = dataset[chosen]
    pictures = {part: example[layer] for part, layer in parts.items()}
    if parts["mask"] == "mask_field" and ROUGH in pictures:
        pictures["mask"] = unhidden(pictures["mask"], pictures[ROUGH])
    return ComposeInput(name=f"{folder}, example {chosen}", lighting=lighting_of(dataset.label(chosen)), **pictures)


def unhidden(mask_field: np.ndarray, mask_rough: np.ndarray) -> np.ndarray:
    """(H, W, 1) what shows of a field, which is seen alone: no more than of its mesh, which furniture may hide."""
    return np.minimum(mask_field, mask_rough)


def _layers_of_parts(folder: Path) -> dict[str, str]:
    """The layer that each part of a frame is read from."""
    extents = {layer.name: layer.extent for layer in load_manifest(folder).layers}
    missing = [name for name in NEEDED if name not in extents]
    masks = [name for name in MASKS if name in extents]
    frames = [name for name in (*FRAMES, EMPTY) if name in extents]
    missing += ([] if masks else [" or ".join(MASKS)]) + ([] if frames else [" or ".join((*FRAMES, EMPTY))])
    if missing:
        raise _wrong(folder, "layers", f"expected {', '.join(NEEDED)}, a mask and a frame of the scene, "
                     f"{', '.join(missing)} missing")
    whole = [name for name in frames if extents[name] == "frame"]
    if not whole:
        raise _wrong(folder, f"layers.{frames[0]}", "expected the extent frame, since the scene around the object is "
                     f"needed, got {extents[frames[0]]}", f"build with --set layers.{frames[0]}=frame")
    parts = {**{name: name for name in NEEDED}, "mask": masks[0]}
    parts |= {"background": whole[0]} if whole[0] != EMPTY else {}
    parts |= {"empty": EMPTY} if EMPTY in whole else {}
    return parts | ({ROUGH: ROUGH} if ROUGH in extents else {})


def _key(dataset: Dataset, folder: Path, key: str, split: str, index: int) -> str:
    keys = {name for several in dataset.splits.values() for name in several}
    if key:
        if key not in keys:
            raise _wrong(folder, "", f"expected the key of an example, such as {min(keys)}, got {key}")
        return key
    if split not in dataset.splits:
        raise _wrong(folder, "", f"expected a split among {', '.join(dataset.splits)}, got {split}")
    own = dataset.splits[split]
    if not 0 <= index < len(own):
        raise _wrong(folder, "", f"expected an index from 0 to {len(own) - 1} in split {split}, got {index}")
    return own[index]


def _read(path: Path) -> np.ndarray:
    try:
        return exr.decode(path.read_bytes(), where=str(path))
    except OSError as error:
        rule = f"expected an EXR file, got: {error.strerror or error}"
        raise UserError([Problem(where=str(path), path="", rule=rule)]) from error


def _broken(name: str, part: np.ndarray, size: tuple[int, int]) -> str:
    """The rule that a picture breaks, or nothing."""
    if part.ndim != 3 or part.shape[2] != PARTS[name]:
        return f"expected {PARTS[name]} channels, got shape {part.shape}"
    if part.shape[:2] != size:
        return f"expected {size[1]} x {size[0]} pixels as i_s, got {part.shape[1]} x {part.shape[0]}"
    if bad := int(np.count_nonzero(~np.isfinite(part))):
        return f"expected finite values, got {bad} that are NaN or Inf"
    if PARTS[name] == 1 and (part.min() < 0 or part.max() > 1):
        return f"expected values in [0, 1], got [{part.min():g}, {part.max():g}]"
    return ""


def _wrong(folder: Path, path: str, rule: str, hint: str = "") -> UserError:
    return UserError([Problem(where=str(folder), path=path, rule=rule, hint=hint)])
