"""An arrangement as plain data for a page: triangles as compressed bytes, lamps with their numbers, the camera."""

import zlib
from base64 import b64encode
from collections.abc import Iterable
from typing import Any

import numpy as np

from dataset_builder.report.looking.arrangement_picture import (
    CAMERA_COLOUR,
    TARGET_COLOUR,
    box_edges,
    camera_name,
    frustum,
    light_name,
)
from dataset_builder.report.looking.light_shapes import COLOURS, LightShape
from dataset_builder.report.looking.plain_numbers import FINE, metres, plain
from dataset_builder.report.looking.shown_arrangement import BELOW_ROOF, ShownArrangement
from dataset_builder.report.looking.standing import StandingThing

STEPS = 65535
"""Steps of a coordinate along a side of a thing's box: a tenth of a millimetre of a room."""
LEVEL = 6
"""Of zlib's compression."""
DECIMALS = 7
"""Of metres, so that a millimetre keeps its shape."""
VIEWER = 960, 640
"""Frame that the first viewer of a page is meant for, pixels."""


def arrangement_data(shown: ShownArrangement) -> dict[str, Any]:
    """All that a page draws, in metres. `roof` is None where nothing is above; `eye` sees `fov` degrees of height;
    `reach` is the box of all of it."""
    eye = shown.eye(*VIEWER)
    rise = np.degrees(2 * np.arctan(np.tan(np.radians(eye.fov) / 2) * eye.aspect))
    points = np.vstack([*(each.box for each in shown.things), *(each.at for each in shown.lights),
                        *([shown.camera.position] if shown.camera else [])])
    return {"things": [_thing(each, shown) for each in shown.things],
            "lights": [_light(each, shown) for each in shown.lights],
            "camera": _camera(shown), "target": {"colour": _hex(TARGET_COLOUR), "centre": _floats(shown.centre),
                                                 "lines": _floats(box_edges(shown.target.box))},
            "reach": {"low": _floats(points.min(axis=0)), "high": _floats(points.max(axis=0))},
            "roof": round(shown.roof - BELOW_ROOF, 4) if np.isfinite(shown.roof) else None,
            "eye": {"position": _floats(eye.position), "target": _floats(eye.target), "fov": round(float(rise), 2)}}


def _thing(thing: StandingThing, shown: ShownArrangement) -> dict[str, Any]:
    low, high = thing.box
    scaled = (thing.positions - low) / np.maximum(high - low, 1e-9) * STEPS
    data = b"".join([thing.faces.astype("<u4").tobytes(), np.rint(scaled).clip(0, STEPS).astype("<u2").tobytes(),
                     thing.colours.tobytes(), thing.clear.astype(np.uint8).tobytes()])
    base = [*(low[:2] + high[:2]) / 2, low[2]]
    rows = [("category", thing.category), ("size", " × ".join(map(metres, high - low)) + " m"),
            ("middle of its foot", _place(base, near=float((high - low).max())))]
    rows += [("turned by", f"{thing.yaw:.1f}°")] if thing.yaw is not None else []
    return {"name": thing.name, "part": thing.part, "category": thing.category,
            "away": float(np.linalg.norm(thing.box.mean(axis=0) - shown.centre)), "low": _floats(low),
            "side": _floats(high - low), "vertices": len(thing.positions), "triangles": len(thing.faces),
            "rows": [*rows, ("triangles", f"{len(thing.faces):,}")],
            "data": b64encode(zlib.compress(data, LEVEL)).decode()}


def _light(each: LightShape, shown: ShownArrangement) -> dict[str, Any]:
    light = each.light
    rows: list[tuple[str, str]] = [("kind", light.kind), ("illumination", each.of)]
    if not each.outside:
        away = float(np.linalg.norm(each.at - shown.centre))
        rows += [("position", _place(light.position, near=away)), ("from the target", f"{metres(away)} m")]
    if any(light.direction):
        rows.append(("shines along", _place(light.direction, unit="")))
    rows += [(name, f"{plain(value)} {unit}") for name, value, unit in (
        ("size", light.size, "m"), ("length", light.length, "m"), ("cutoff", light.cutoff, "°"),
        ("temperature", light.temperature, "K")) if value]
    rows += [("image", light.image)] if light.image else []
    rows += [("strength", " ".join(map(plain, light.radiance)) + f" {each.unit}"),
             ("at the target", f"{plain(light.weight)} W/m²")]
    return {"name": each.name, "label": light_name(each, shown), "of": each.of, "kind": light.kind,
            "at": _floats(each.at), "rows": rows,
            "colour": _hex(COLOURS[each.of]), "positions": _floats(each.positions),
            "faces": each.faces.ravel().tolist(), "lines": _floats(each.lines)}


def _camera(shown: ShownArrangement) -> dict[str, Any] | None:
    camera = shown.camera
    if camera is None:
        return None
    away = float(np.linalg.norm(camera.position - shown.centre))
    rows = [("position", _place(camera.position, near=away)),
            ("from the target", f"{metres(away)} m"), ("field of view", f"{camera.fov:.1f}° across"),
            ("picture", f"{camera.width} × {camera.height} pixels")]
    return {"label": camera_name(camera, shown), "position": _floats(camera.position), "target": _floats(camera.target),
            "up": _floats(camera.up), "fov": camera.fov, "width": camera.width, "height": camera.height,
            "colour": _hex(CAMERA_COLOUR), "lines": _floats(frustum(camera, shown.centre)), "rows": rows}


def _place(values: Iterable[float], *, unit: str = " m", near: float = 1.0) -> str:
    """Three numbers to read; none is -0.00. near: metres to what they are read against."""
    digits = 2 if near >= FINE else 5
    return ", ".join(f"{round(float(value), digits) + 0.0:.{digits}f}" for value in values) + unit


def _floats(values: np.ndarray) -> list[float]:
    return [round(value, DECIMALS) for value in np.ravel(values).tolist()]


def _hex(colour: tuple[int, int, int]) -> str:
    return "#" + "".join(f"{channel:02x}" for channel in colour)
