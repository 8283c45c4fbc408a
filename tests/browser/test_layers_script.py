"""`scripts/layers.js`, against NumPy and the package's own tone mapping, over every half float."""

from base64 import b64decode
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
import pytest

from dataset_builder import tonemap
from dataset_builder.report.front.fill_page import HERE
from dataset_builder.report.gallery.example_payload import example_payload
from tests.browser.made_up import lit_ball

if TYPE_CHECKING:
    from playwright.sync_api import Page

CODES = np.arange(65536, dtype=np.uint16)
with np.errstate(invalid="ignore"):
    VALUES = CODES.view(np.float16).astype(np.float32)
AS_TEXT = """array => { const bytes = new Uint8Array(array.buffer); let text = '';
for (const byte of bytes) text += String.fromCharCode(byte); return btoa(text); }"""


@pytest.fixture
def script(page: "Page") -> "Page":
    """A page with the script and nothing else."""
    page.add_script_tag(content=(HERE / "scripts" / "layers.js").read_text(encoding="utf-8"))
    return page


def array(page: "Page", expression: str, dtype: str, argument: Any = None) -> np.ndarray:
    """The typed array that an expression gives."""
    text = page.evaluate(f"async argument => ({AS_TEXT})(await ({expression}))", argument)
    return np.frombuffer(b64decode(text), dtype)


def test_every_half_float_has_its_value(script: "Page") -> None:
    np.testing.assert_array_equal(array(script, "Layers.VALUES", "<f4"), VALUES)


@pytest.mark.parametrize("factor", [1.0, 0.37, 2**-9.3, 900.0])
def test_tone_mapping_is_that_of_the_package(script: "Page", factor: float) -> None:
    finite = np.isfinite(VALUES)
    found = array(script, "Layers.toneTable(argument)", "u1", factor)[finite]
    np.testing.assert_array_equal(found, tonemap.to_8bit(VALUES[finite].reshape(1, -1, 1), factor)[0, :, 0])


def test_the_nearest_code_is_numpys(script: "Page") -> None:
    values = np.concatenate([np.geomspace(1e-8, 65504, 4001), [0, -1, 2**-24, 1, 65504]]).astype(np.float32)
    found = array(script, "Uint16Array.from(argument, Layers.nearestCode)", "<u2", values.tolist())
    np.testing.assert_array_equal(found, np.maximum(values, 0).astype(np.float16).view(np.uint16))


@pytest.mark.parametrize(("name", "colours"), [("length", "viridis"), ("error", "magma")])
def test_false_colour_keeps_to_its_map(script: "Page", name: str, colours: str) -> None:
    found = array(script, "Layers.colourTable(argument, 0, 1)", "u1", name).reshape(-1, 4)
    shares = (VALUES >= 0) & (VALUES <= 1)
    expected = matplotlib.colormaps[colours](VALUES[shares])[:, :3]
    assert np.abs(found[shares, :3] / 255 - expected).max() < 0.025
    np.testing.assert_array_equal(found[VALUES == 2], found[VALUES == 1])


def test_layers_come_out_as_they_went_in(script: "Page") -> None:
    example = lit_ball(3)
    payload = example_payload(example)
    for layer in payload["layers"]:
        count = payload["width"] * payload["height"] * layer["channels"]
        codes = array(script, f"Layers.decode(argument, {count})", "<u2", layer["data"])
        expected = np.moveaxis(example[layer["name"]], 2, 0).astype(np.float16)
        np.testing.assert_array_equal(codes.view(np.float16), expected.ravel())


def test_automatic_exposure_is_that_of_the_package(script: "Page") -> None:
    example = lit_ball(5)
    found = script.evaluate("async payload => Layers.exposure(await Layers.decodeAll(payload))",
                            example_payload(example))
    assert found == pytest.approx(tonemap.exposure([example["i_s"], example["i_t"]]), rel=0.01)


def test_what_a_picture_does_not_show_is_said(script: "Page") -> None:
    pixels = np.array([[-1.0, 1e6], [0.5, 0.25]], np.float32)[..., None].repeat(3, 2)
    payload = example_payload({"air": pixels})
    remarks = script.evaluate("async payload => Layers.remarks((await Layers.decodeAll(payload))[0])", payload)
    assert remarks == ["3 values beyond 65504 are cut there", "3 values below 0 are shown as 0"]


def test_a_layer_of_another_size_is_refused(script: "Page") -> None:
    payload = example_payload(lit_ball(1))
    message = script.evaluate("data => Layers.decode(data, 5).catch(error => error.message)",
                              payload["layers"][0]["data"])
    assert message == f"expected 5 values, got {3 * payload['width'] * payload['height']}"
