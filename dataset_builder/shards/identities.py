"""Identities of every example, as functions of arrays: each returns the violations that it finds, with figures.

The same functions gate examples before they are written and verify them afterwards. Arrays are (H, W, C) float32 as
they read after storage; all tolerances stand here and in `dataset.json`.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dataset_builder.layers import EVERYWHERE, HALF, LAYERS, Extent, layers_of

RANGE, REFLECTANCE, MASK, OUTSIDE, SHARED, FIELD = "range", "reflectance", "mask", "outside", "shared", "field"
SHARED_LAYERS = layers_of("first_hit")
"""Layers that need no light: rendered once per view, so bit-identical in all of its examples."""

SEEN = layers_of("source")
"""Layers that show a field, where an example is seen through one."""

LOST = 1e-3
"""Share of a layer's mean that storing it may change."""
PARTS = ("spec", "air")
"""Layers that are differences: what rounding leaves of them where they are 0 is no light."""

_TOLERANCES = {"float32": {RANGE: 1e-5, REFLECTANCE: 1e-3}, "float16": {RANGE: 1e-3, REFLECTANCE: 2e-3}}


@dataclass(frozen=True, kw_only=True)
class Violation:
    """A rule that does not hold."""

    identity: str
    """The rule's name."""
    reason: str
    """The figures in one sentence."""


def identity_table(dtype: str, fields: bool = False) -> tuple[tuple[str, str, float], ...]:
    """(name, rule, tolerance) of every identity that can be checked from the files, for layers stored as `dtype`.
    fields: whether `i_s` of some examples is the image of a field."""
    tolerance, of_field = _TOLERANCES[dtype], ", but for those of the image of a field," * fields
    return (
        (RANGE, "every value is finite and in its layer's range, to tolerance", tolerance[RANGE]),
        (REFLECTANCE, "d + r <= 1 + tolerance in every channel", tolerance[REFLECTANCE]),
        (MASK, "mask is not empty", 0.0),
        (OUTSIDE, f"layers of extent object{of_field} are exactly 0 where the object covers nothing of the pixel",
         0.0),
        (SHARED, f"examples of one view share {', '.join(SHARED_LAYERS)}, bit by bit", 0.0),
        *(((FIELD, "i_s of a field is 0 where mask_field is 0, to tolerance in units of its largest value",
            tolerance[RANGE]),) if fields else ()),
    )


def check_layers(layers: Mapping[str, np.ndarray], extents: Mapping[str, Extent], tolerances: Mapping[str, float],
                 field: bool = False) -> list[Violation]:
    """Every identity inside one example; `tolerances` by name as `identity_table` gives them. field: whether its `i_s`
    is the image of a field, as `plan.field` of its label says."""
    found = [violation for name, array in layers.items() for violation in in_range(name, array, tolerances[RANGE])]
    if {"i_t", HALF} <= set(layers):
        found += other_half(layers["i_t"], layers[HALF], tolerances[RANGE])
    if "d" in layers and "r" in layers:
        found += reflectance_sum(layers["d"], layers["r"], tolerances[REFLECTANCE])
    if "mask" in layers:
        found += mask_not_empty(layers["mask"])
        rendered = {name: array for name, array in layers.items() if not (field and name in SEEN)}
        found += outside_object(rendered, extents)
    if field and {"i_s", "mask_field"} <= set(layers):
        found += outside_field(layers["i_s"], layers["mask_field"], tolerances[FIELD])
    return found


def storable(layers: Mapping[str, np.ndarray], dtype: str) -> list[Violation]:
    """Layers that `dtype` cannot hold: a value beyond the largest finite one would become infinite, and what is next to
    nothing loses its digits or becomes 0, see `_too_dim`."""
    limit = float(np.finfo(dtype).max)
    largest = {name: float(np.abs(array).max(initial=0.0)) for name, array in layers.items()}
    found = [Violation(identity=RANGE, reason=f"{name}: expected at most {limit:g}, what {dtype} holds, got {value:g}")
             for name, value in largest.items() if value > limit]
    return found + _too_dim({name: array for name, array in layers.items() if largest[name] <= limit}, dtype)


def _too_dim(layers: Mapping[str, np.ndarray], dtype: str) -> list[Violation]:
    """Layers without a largest value that lose more than `LOST` of their mean to rounding. Each normal number loses at
    most half a step, 2^-11 in half precision; below the least of them, 6.1e-5, steps are all 6e-8.

    A standard error is held to the mean of its layer, and a part of the image to the image: what is nothing beside that
    may become nothing.
    """
    means = {name: float(np.abs(array).mean(dtype=np.float64)) for name, array in layers.items()
             if LAYERS[name].high == np.inf} if dtype == "float16" else {}
    found = []
    for name in means:
        base = name.removesuffix("_se").removesuffix("_raw")
        scale = max(means.get(each, 0.0) for each in (name, base, *(("i_t", "s") if base in PARTS else ())))
        array = layers[name]
        kept = array.astype(dtype).astype(np.float64)
        lost = float(np.abs(array - kept).mean())
        if lost > LOST * scale:
            gone, there = np.count_nonzero((kept == 0) & (array != 0)), np.count_nonzero(array)
            found.append(Violation(identity=RANGE, reason=(
                f"{name}: expected {dtype} to lose at most {LOST:.1%} of its mean of {means[name]:.3g}, got "
                f"{lost / scale:.1%} lost and {gone} of {there} values become 0: below 6.1e-05 it has few digits or "
                "none (store float32, or ask for brighter light)")))
    return found


def in_range(name: str, array: np.ndarray, tolerance: float) -> list[Violation]:
    """Finite, and low - tolerance <= x <= high + tolerance with the layer's own bounds; radiance is never below 0."""
    if bad := int(np.count_nonzero(~np.isfinite(array))):
        return [Violation(identity=RANGE, reason=f"{name}: expected finite values, got {bad} that are NaN or Inf")]
    layer = LAYERS[name]
    least, largest = float(array.min()), float(array.max())
    low = layer.low - tolerance if layer.low else 0.0
    if low <= least and largest <= layer.high + tolerance:
        return []
    reason = f"{name}: expected values in [{layer.low:g}, {layer.high:g}], got [{least:g}, {largest:g}]"
    return [Violation(identity=RANGE, reason=reason)]


def other_half(i_t: np.ndarray, half: np.ndarray, tolerance: float) -> list[Violation]:
    """i_t_half <= 2 i_t (1 + tolerance): what the other half of the samples says is no less than 0."""
    over = half - (1 + tolerance) * 2 * i_t.astype(np.float64)
    if (largest := float(over.max(initial=0.0))) <= tolerance:
        return []
    return [Violation(identity=RANGE, reason=f"{HALF}: expected at most 2 i_t, got {largest:g} more")]


def reflectance_sum(d: np.ndarray, r: np.ndarray, tolerance: float) -> list[Violation]:
    """Energy: no surface sends back more than it receives, D + R <= 1 + tolerance per pixel and channel."""
    total = d.astype(np.float64) + r
    if (largest := float(total.max())) <= 1 + tolerance:
        return []
    row, column = (int(i) for i in np.unravel_index(total.argmax(), total.shape)[:2])
    count = int(np.count_nonzero(total.max(axis=2) > 1 + tolerance))
    place = f"at row {row}, column {column}, {count} pixels in all"
    reason = f"expected d + r <= {1 + tolerance:g}, got {largest:g} {place}"
    return [Violation(identity=REFLECTANCE, reason=reason)]


def mask_not_empty(mask: np.ndarray) -> list[Violation]:
    """The target object covers something."""
    return [] if mask.any() else [Violation(identity=MASK, reason="expected an object in the picture, mask is empty")]


def outside_object(layers: Mapping[str, np.ndarray], extents: Mapping[str, Extent]) -> list[Violation]:
    """Layers of extent `object` are exactly 0 where their mesh covers nothing of the pixel (`EVERYWHERE` aside).

    For layers of the 3DM that is where mask = 0. Layers of the R3DM are traced wherever either mesh is: where mask = 0
    and mask_rough = 0; without `mask_rough` among `layers` nothing can be said about them.
    """
    outside = {"3dm": layers["mask"][..., 0] == 0}
    if "mask_rough" in layers:
        outside["r3dm"] = outside["3dm"] & (layers["mask_rough"][..., 0] == 0)
    found = []
    for name, array in layers.items():
        where = outside.get(LAYERS[name].geometry)
        if where is None or name in EVERYWHERE or extents[name] != "object":
            continue
        if count := int(np.count_nonzero(array.any(axis=2) & where)):
            reason = f"{name}: expected 0 outside the object, got {count} pixels that are not"
            found.append(Violation(identity=OUTSIDE, reason=reason))
    return found


def outside_field(i_s: np.ndarray, mask_field: np.ndarray, tolerance: float) -> list[Violation]:
    """The image of a field is 0 where its opacity is: not exactly, since 1 less what passes rounds to 0 before the
    light does."""
    beyond = (i_s > tolerance * max(float(i_s.max(initial=0)), 0.0)).any(axis=2) & (mask_field[..., 0] == 0)
    if not (count := int(np.count_nonzero(beyond))):
        return []
    return [Violation(identity=FIELD, reason=f"i_s: expected 0 where mask_field is 0, got {count} pixels that are not, "
                                             f"up to {float(i_s[beyond].max()):g}")]


def shared_in_view(first: Mapping[str, str], other: Mapping[str, str]) -> list[Violation]:
    """Pixel digests by layer name of two examples of one view: light-free layers are bit-identical."""
    return [Violation(identity=SHARED, reason=f"{name}: expected the same pixels in every example of the view")
            for name in SHARED_LAYERS if name in first and first[name] != other.get(name)]
