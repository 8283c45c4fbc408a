"""An arrangement as plain data for a page: triangles as compressed bytes, lamps with their numbers, the camera."""

import zlib
from base64 import b64encode
from collections.abc import Iterable
from typing import Any

import numpy as np

from dataset_builder.report.looking.arrangement_picture import CAMERA_COLOUR, TARGET_COLOUR, box_edges, frustum
from dataset_builder.report.looking.light_shapes import COLOURS, LightShape
from dataset_builder.report.looking.shown_arrangement import BELOW_ROOF, ShownArrangement
from dataset_builder.report.looking.standing import StandingThing

STEPS = 65535
"""Steps of a coordinate along a side of a thing's box: a tenth of a millimetre of a room."""
LEVEL = 6
"""Of zlib's compression."""
VIEWER = 960, 640
"""Frame that the first viewer of a page is meant for, pixels."""


def arrangement_data(shown: ShownArrangement) -> dict[str, Any]:
    """All that a page draws, in metres. `roof` is None where nothing is above; `eye` sees `fov` degrees of height."""
    eye = shown.eye(*VIEWER)
    rise = np.degrees(2 * np.arctan(np.tan(np.radians(eye.fov) / 2) * eye.aspect))
    return {"things": [_thing(each) for each in shown.things], "lights": [_light(each, shown) for each in shown.lights],
            "camera": _camera(shown), "target": {"colour": _hex(TARGET_COLOUR), "centre": _floats(shown.centre),
                                                 "lines": _floats(box_edges(shown.target.box))},
            "roof": round(shown.roof - BELOW_ROOF, 4) if np.isfinite(shown.roof) else None,
            "eye": {"position": _floats(eye.position), "target": _floats(eye.target), "fov": round(float(rise), 2)}}


def _thing(thing: StandingThing) -> dict[str, Any]:
    low, high = thing.box
    scaled = (thing.positions - low) / np.maximum(high - low, 1e-9) * STEPS
    data = b"".join([thing.faces.astype("<u4").tobytes(), np.rint(scaled).clip(0, STEPS).astype("<u2").tobytes(),
                     thing.colours.tobytes(), thing.clear.astype(np.uint8).tobytes()])
    base = [*(low[:2] + high[:2]) / 2, low[2]]
    rows = [("category", thing.category), ("size", " × ".join(f"{side:.2f}" for side in high - low) + " m"),
            ("middle of its foot", _place(base))]
    rows += [("turned by", f"{thing.yaw:.1f}°")] if thing.yaw is not None else []
    return {"name": thing.name, "part": thing.part, "category": thing.category, "low": _floats(low),
            "side": _floats(high - low), "vertices": len(thing.positions), "triangles": len(thing.faces),
            "rows": [*rows, ("triangles", f"{len(thing.faces):,}")],
            "data": b64encode(zlib.compress(data, LEVEL)).decode()}


def _light(each: LightShape, shown: ShownArrangement) -> dict[str, Any]:
    light = each.light
    rows = [("kind", light.kind), ("illumination", each.of)]
    if not each.outside:
        away = np.linalg.norm(each.at - shown.centre)
        rows += [("position", _place(light.position)),
                 ("from the target", f"{away:.2f} m")]
    if any(light.direction):
        rows.append(("shines along", _place(light.direction, "")))
    rows += [(name, f"{value:.3g} {unit}") for name, value, unit in (
        ("size", light.size, "m"), ("length", light.length, "m"), ("cutoff", light.cutoff, "°"),
        ("temperature", light.temperature, "K")) if value]
    rows += [("image", light.image)] if light.image else []
    rows += [("strength", " ".join(f"{value:.3g}" for value in light.radiance) + f" {each.unit}"),
             ("at the target", f"{light.weight:.3g} W/m²")]
    return {"name": each.name, "of": each.of, "kind": light.kind, "at": _floats(each.at), "rows": rows,
            "colour": _hex(COLOURS[each.of]), "positions": _floats(each.positions),
            "faces": each.faces.ravel().tolist(), "lines": _floats(each.lines)}


def _camera(shown: ShownArrangement) -> dict[str, Any] | None:
    camera = shown.camera
    if camera is None:
        return None
    away = float(np.linalg.norm(camera.position - shown.centre))
    rows = [("position", _place(camera.position)),
            ("from the target", f"{away:.2f} m"), ("field of view", f"{camera.fov:.1f}° across"),
            ("picture", f"{camera.width} × {camera.height} pixels")]
    return {"name": "camera", "position": _floats(camera.position), "target": _floats(camera.target),
            "up": _floats(camera.up), "fov": camera.fov, "width": camera.width, "height": camera.height,
            "colour": _hex(CAMERA_COLOUR), "lines": _floats(frustum(camera, shown.centre)), "rows": rows}


def _place(values: Iterable[float], unit: str = " m") -> str:
    """Three numbers to read; none is -0.00."""
    return ", ".join(f"{round(float(value), 2) + 0.0:.2f}" for value in values) + unit


def _floats(values: np.ndarray) -> list[float]:
    return [round(value, 5) for value in np.ravel(values).tolist()]


def _hex(colour: tuple[int, int, int]) -> str:
    return "#" + "".join(f"{channel:02x}" for channel in colour)
