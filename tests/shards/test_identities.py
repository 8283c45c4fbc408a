import numpy as np
import pytest

from dataset_builder.layers import Extent
from dataset_builder.shards.gates import (
    check_gates,
    combined_error,
    coverage,
    mask_overlap,
    radiance_split,
    s_prime_energy,
)
from dataset_builder.shards.identities import (
    check_layers,
    identity_table,
    in_range,
    mask_not_empty,
    other_half,
    outside_object,
    reflectance_sum,
    shared_in_view,
)
from dataset_builder.spec.dataset import GatesSpec
from tests.plans import PAPER
from tests.shards.tiny_dataset import make_layers

EXTENTS: dict[str, Extent] = dict(PAPER)  # type: ignore[arg-type]
TOLERANCES = {name: tolerance for name, _, tolerance in identity_table("float32")}


def full(value: float, channels: int = 3) -> np.ndarray:
    return np.full((4, 5, channels), value, np.float32)


def test_good_layers_break_nothing() -> None:
    assert check_layers(make_layers("train/000000"), EXTENTS, TOLERANCES) == []


@pytest.mark.parametrize(("layer", "value"), [("i_t", -1e-6), ("d", 1.001), ("mask", -0.01), ("mask", 1.01),
                                              ("i_s", float("nan")), ("s_prime", float("inf"))])
def test_values_out_of_range_are_found_with_figures(layer: str, value: float) -> None:
    layers = make_layers("train/000000")
    layers[layer][2, 3] = value
    found = check_layers(layers, EXTENTS, TOLERANCES)
    assert found[0].identity == "range" and found[0].reason.startswith(f"{layer}: expected")


def test_range_allows_rounding_and_no_more() -> None:
    assert in_range("d", full(1 + 5e-6), 1e-5) == []
    assert in_range("d", full(1 + 2e-5), 1e-5) != []
    assert in_range("normal", full(-1 - 5e-6), 1e-5) == []


def test_no_surface_sends_back_more_than_it_receives() -> None:
    assert reflectance_sum(full(0.6), full(0.4), 1e-3) == []
    r = full(0.4)
    r[1, 2, 0] = 0.5
    violation, = reflectance_sum(full(0.6), r, 1e-3)
    assert violation.reason == "expected d + r <= 1.001, got 1.1 at row 1, column 2, 1 pixels in all"


def test_an_empty_mask_is_found() -> None:
    assert mask_not_empty(full(0, 1))[0].identity == "mask"


@pytest.mark.parametrize("layer", ["d", "r"])
def test_object_layers_hold_nothing_outside_the_object(layer: str) -> None:
    layers = make_layers("train/000000")
    layers[layer][0, 0, 1] = 1e-7
    assert [v.identity for v in outside_object(layers, EXTENTS)] == ["outside"]
    assert outside_object(layers, EXTENTS | {layer: "frame"}) == []


def test_frame_layers_may_hold_anything_outside_the_object() -> None:
    layers = make_layers("train/000000")
    assert layers["i_s"][0, 0].any() and outside_object(layers, EXTENTS) == []


def test_rough_layers_are_held_to_both_masks() -> None:
    layers = make_layers("train/000000")
    layers["mask_rough"] = layers["mask"].copy()
    layers["mask_rough"][0, 0] = 0.25
    layers["s_prime"][0, 0] = 1.0
    assert outside_object(layers, EXTENTS) == []
    layers["s_prime"][0, 1] = 1.0
    violation, = outside_object(layers, EXTENTS)
    assert violation.reason == "s_prime: expected 0 outside the object, got 1 pixels that are not"


def test_light_free_layers_of_a_view_agree() -> None:
    first = {"d": "a", "mask": "b", "i_t": "c"}
    assert shared_in_view(first, {"d": "a", "mask": "b", "i_t": "other"}) == []
    assert [v.reason[:4] for v in shared_in_view(first, {"d": "a", "mask": "x", "i_t": "c"})] == ["mask"]


def test_gates_know_their_own_figures() -> None:
    mask = np.zeros((4, 4, 1), np.float32)
    mask[:2, :2] = 1
    assert coverage(mask, (0.25, 0.25)) == []
    assert coverage(mask, (0.3, 0.9))[0].reason.endswith("in [0.3, 0.9], got 0.25")
    shifted = np.roll(mask, 1, axis=1)
    assert mask_overlap(mask, shifted, 1 / 3) == [] and mask_overlap(mask, shifted, 0.34) != []
    s_prime = np.full((4, 4, 3), 2.0, np.float32)
    assert s_prime_energy(s_prime, mask, (2.0, 2.0)) == []
    assert s_prime_energy(s_prime * 0, mask, (1e-3, 1e3))[0].identity == "s_prime_energy"


def footprint(seed: int, samples: int = 64) -> dict[str, np.ndarray]:
    """Estimates of a pixel whose albedo and shading vary inside it and agree in sign, from shared samples."""
    generator = np.random.Generator(np.random.PCG64(seed))
    edge = generator.random((samples, 4, 5, 1)) < 0.5
    d, s = np.where(edge, 0.8, 0.1), np.where(edge, 5.0, 1.0) * generator.uniform(0.5, 1.5, (samples, 4, 5, 3))
    spec = generator.exponential(0.2, (samples, 4, 5, 3))
    d = np.broadcast_to(d, s.shape)
    i_t = d * s + spec

    def error(values: np.ndarray) -> np.ndarray:
        return (values.std(axis=0, ddof=1) / samples**0.5).astype(np.float32)

    means = {name: values.mean(axis=0).astype(np.float32) for name, values in
             (("i_t", i_t), ("d", d), ("s", s), ("spec", spec))}
    return means | {"sd_d": d.std(axis=0).astype(np.float32), "sd_s": s.std(axis=0).astype(np.float32),
                    "i_t_se": error(i_t), "s_se": error(s), "spec_se": error(spec)}


def test_covariance_inside_a_pixel_is_no_violation_without_any_help_of_noise() -> None:
    e = footprint(1)
    assert np.abs(e["i_t"] - e["d"] * e["s"] - e["spec"]).min() > 0.1
    kept = {name: e[name] for name in ("i_t", "d", "s", "spec", "sd_d", "sd_s")}
    assert radiance_split(**kept, error=np.zeros_like(e["i_t"])) == []


def test_energy_that_is_lost_is_found() -> None:
    e = {name: np.zeros((4, 5, 3), np.float32) for name in footprint(1)} | {"d": full(0.5), "s": full(2.0)}
    e |= {"i_t": full(1.25), "spec": full(0.25)}
    layers, gates = {"mask": np.ones((4, 5, 1), np.float32)}, GatesSpec(coverage=(0, 1))
    assert check_gates(layers, gates, e) == []
    e["i_t"][3, 1, 2] = 1.2501
    violation, = check_gates(layers, gates, e)
    assert violation.identity == "radiance_split" and "row 3, column 1, 1 pixels" in violation.reason
    e["i_t_se"][3, 1, 2] = 2.1e-5
    assert check_gates(layers, gates, e) == []


def test_errors_add_up_as_if_they_were_one() -> None:
    error = combined_error(d=full(0.5), s=full(4), d_se=full(0.25), i_t_se=full(1), s_se=full(2), spec_se=full(3))
    assert error == pytest.approx(1 + 0.5 * 2 + 4 * 0.25 + 3)


def test_albedo_from_other_samples_is_allowed_its_own_error() -> None:
    """An edge between two albedos under even light: without the error of d itself, chance would reject it."""
    generator, spp, batches = np.random.Generator(np.random.PCG64(3)), 16, 4

    def albedo() -> np.ndarray:
        edge = generator.random((spp, 100, 100, 1)) < 0.5
        return np.broadcast_to(np.where(edge, 0.9, 0.1), (spp, 100, 100, 3))

    first, target = albedo(), albedo()
    parts = (2 * target).reshape(batches, -1, 100, 100, 3).mean(axis=1)
    zero = np.zeros((100, 100, 3), np.float32)
    evidence = {name: zero for name in ("spec", "spec_se", "s_se", "sd_s")} | {
        "i_t": parts.mean(axis=0), "i_t_se": parts.std(axis=0, ddof=1) / batches**0.5, "s": zero + 2,
        "d": first.mean(axis=0), "sd_d": first.std(axis=0)}
    layers, gates = {"mask": np.ones((100, 100, 1), np.float32)}, GatesSpec(coverage=(0, 1))
    assert check_gates(layers, gates, evidence) != []
    assert check_gates(layers, gates, evidence, (spp, spp)) == []
    assert check_gates(layers, gates, evidence | {"i_t": 4 * evidence["i_t"]}, (spp, spp)) != []


def test_a_few_pixels_may_be_unlucky_but_none_may_be_nan() -> None:
    arrays = {name: np.ones((50, 20, 3), np.float32) for name in ("i_t", "d", "s")}
    zeros = {name: np.zeros((50, 20, 3), np.float32) for name in ("spec", "error", "sd_d", "sd_s")}
    arrays["i_t"][4, :2] = 2
    assert radiance_split(**arrays, **zeros) == []
    arrays["i_t"][4, 2] = 2
    assert radiance_split(**arrays, **zeros)[0].reason.endswith("3 pixels in all")
    arrays["i_t"][4] = 1
    arrays["i_t"][4, 0, 0] = np.nan
    assert radiance_split(**arrays, **zeros) != []


def test_evidence_on_the_object_goes_before_layers_on_the_frame() -> None:
    e = footprint(1)
    for array in e.values():
        array[0] = 0
    frame = e["i_t"].copy()
    frame[0] = 9
    assert check_gates({"mask": np.ones((4, 5, 1), np.float32), "i_t": frame}, GatesSpec(coverage=(0, 1)), e) == []


def test_nan_evidence_never_passes() -> None:
    e = footprint(2)
    e["s"][0, 0, 0] = np.nan
    assert check_gates({"mask": np.ones((4, 5, 1), np.float32)}, GatesSpec(coverage=(0, 1)), e) != []


def test_the_image_of_a_field_ends_where_its_opacity_does() -> None:
    layers = make_layers("train/000000")
    extents: dict[str, Extent] = {**EXTENTS, "i_s": "object", "mask_field": "object"}
    inside = (layers["mask"] > 0).astype(np.float32)
    opacity = np.zeros_like(layers["mask"])
    opacity[1:5, 2:7] = 0.5
    i_s = np.ones((*opacity.shape[:2], 3), np.float32) * opacity
    seen = layers | {"i_s": i_s, "mask_field": opacity, "i_t": layers["i_t"] * inside}
    with_field = {name: tolerance for name, _, tolerance in identity_table("float32", True)}
    assert {each.identity for each in check_layers(seen, extents, with_field)} == {"outside"}
    assert check_layers(seen, extents, with_field, True) == []
    # What rounding leaves of an opacity of 0 is no light
    seen["i_s"][0, 0] = 5e-6 * seen["i_s"].max()
    assert check_layers(seen, extents, with_field, True) == []
    seen["i_s"][0, 0] = 0.01
    violation, = check_layers(seen, extents, with_field, True)
    assert (violation.identity, violation.reason) == (
        "field", "i_s: expected 0 where mask_field is 0, got 1 pixels that are not, up to 0.01")
    del seen["mask_field"]
    assert check_layers(seen, extents, with_field, True) == []


def test_the_table_tells_of_fields_where_there_are_some() -> None:
    plain, seen = identity_table("float16"), identity_table("float16", True)
    assert [name for name, _, _ in seen if name not in dict.fromkeys(each[0] for each in plain)] == ["field"]
    assert [name for name, rule, _ in seen if "image of a field" in rule] == ["outside"]


def test_a_field_beside_its_mesh_is_rejected() -> None:
    mask = np.zeros((8, 8, 1), np.float32)
    mask[2:6, 2:6] = 1
    bounds = GatesSpec(mask_overlap=0.8, coverage=(0, 1))
    moved = np.roll(mask, 1, axis=1)
    # Three quarters of the object are hidden by what stands before it, and not of the field
    hidden = mask * (np.arange(8) < 3)[None, :, None]
    assert check_gates({"mask_field": mask}, bounds, {"mask": mask}) == []
    assert check_gates({"mask_field": mask}, bounds, {"mask": hidden}) == []
    violation, = check_gates({"mask_field": moved}, bounds, {"mask": mask})
    assert (violation.identity, violation.reason) == (
        "mask_overlap", "expected share of mask that mask_field covers in [0.8, 1], got 0.75")


def test_the_other_half_is_no_less_than_nothing() -> None:
    i_t = np.full((2, 2, 3), 0.5, np.float32)
    assert other_half(i_t, 2 * i_t, 1e-5) == []
    violation, = other_half(i_t, 2.2 * i_t, 1e-5)
    assert violation.identity == "range" and violation.reason.startswith("i_t_half: expected at most 2 i_t, got 0.0999")
