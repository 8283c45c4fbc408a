"""What a browser gets of an example, against values worked out by hand."""

import zlib
from base64 import b64decode
from typing import Any

import numpy as np
import pytest

from dataset_builder.layers import LAYERS
from dataset_builder.report.front.fill_page import script_json
from dataset_builder.report.gallery.example_payload import example_payload, half_floats, look

HALF_BITS = [(0.0, 0x0000), (1.0, 0x3C00), (-2.0, 0xC000), (65504.0, 0x7BFF), (1 / 3, 0x3555),
             (1 + 2**-11, 0x3C00), (1 + 3 * 2**-11, 0x3C02), (2.0**-24, 0x0001), (2.0**-26, 0x0000)]
"""Values and their nearest half floats, ties to even, by IEEE 754's layout: 1 sign, 5 exponent, 10 fraction bits."""


def decoded(layer: dict[str, Any]) -> bytes:
    """The bytes as a browser sees them."""
    return zlib.decompress(b64decode(layer["data"]))


def test_values_are_the_nearest_half_floats() -> None:
    values, bits = zip(*HALF_BITS, strict=True)
    layer = half_floats(np.array(values, np.float32).reshape(1, -1, 1))
    assert decoded(layer) == b"".join(word.to_bytes(2, "little") for word in bits)
    assert layer["cut"] == 0


def test_what_is_beyond_is_cut_and_counted() -> None:
    layer = half_floats(np.array([65505, -1e9, np.inf, 65504], np.float32).reshape(2, 2, 1))
    assert decoded(layer) == bytes.fromhex("ff7b fffb ff7b ff7b")
    assert layer["cut"] == 3


def test_channels_are_planes() -> None:
    pixels = np.arange(12, dtype=np.float32).reshape(2, 2, 3)
    assert np.frombuffer(decoded(half_floats(pixels)), "<f2").tolist() == [0, 3, 6, 9, 1, 4, 7, 10, 2, 5, 8, 11]


@pytest.mark.parametrize(("name", "expected"), [
    ("i_s", "light"), ("air", "light"), ("i_t_raw", "light"), ("s_prime_se", "error"), ("d", "share"),
    ("mask", "share"), ("mask_field", "share"), ("depth", "length"), ("normal_rough", "direction"),
    ("instance", "number")])
def test_looks(name: str, expected: str) -> None:
    assert look(name) == expected


def test_an_example_with_its_label() -> None:
    record = {"layers": [{"name": "i_t", "relative_error": 0.05, "mean_error": 0.02},
                         {"name": "s", "relative_error": float("nan")}],
              "denoised": [{"layer": "i_t", "bias": -0.002, "bias_error": 0.001, "pixel_bias": 0.04, "relmse_raw": 0.1,
                            "relmse_denoised": 0.02, "relmse_reference": 0.001, "examples": 8}]}
    label = {"key": "00000007", "record": record, "plan": {"render": {"denoise": ["i_t", "s"]}}}
    pixels = np.ones((2, 3, 3), np.float32)
    payload = example_payload({"s": pixels, "mask": pixels[..., :1], "i_t": pixels, "meta": label}, note="at 8 spp")
    assert (payload["key"], payload["title"], payload["note"]) == ("00000007", "00000007", "at 8 spp")
    assert (payload["width"], payload["height"]) == (3, 2)
    assert [(layer["name"], layer["error"]) for layer in payload["layers"]] == [
        ("i_t", 0.05), ("mask", None), ("s", None)]
    assert [layer["denoised"] for layer in payload["layers"]] == [
        "denoised: bias -0.20% ± 0.10%, of a pixel 4.00%; squared error 0.1 before, 0.02 after, of 8 examples", "",
        "denoised; not measured"]
    assert [layer["mean"] for layer in payload["layers"]] == ["mean ± 2.00%", "", ""]
    assert not any(layer["doubtful"] for layer in payload["layers"])
    # NaN of a label becomes null, or a page would not be JSON
    assert payload["label"]["record"]["layers"][1]["relative_error"] is None
    assert '"relative_error":null' in script_json(payload)


def test_pixels_alone() -> None:
    payload = example_payload({"depth": np.zeros((4, 5, 1), np.float32)}, key="k", title="a view")
    assert (payload["label"], payload["title"], payload["layers"][0]["unit"]) == ({}, "a view", LAYERS["depth"].unit)
