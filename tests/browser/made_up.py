"""Examples and galleries that nobody rendered, for tests of pages and for the gallery's benchmark."""

from base64 import b64encode
from io import BytesIO
from typing import Any

import numpy as np
from PIL import Image

from dataset_builder.seeding import rng
from dataset_builder.tonemap import to_8bit

HOSTILE = "</script><img src=x onerror=alert(1)>"
"""A name that must be shown as it is."""
OBJECTS = (("chair", "seating"), ("vase", "decor"), ("lamp", "lamp"), (HOSTILE, "table"))
SCENES, LAMPS, LEVELS = ("kitchen", "loft"), ("area + spot", "point"), ("smooth", "light", "heavy")
SIZE = 24


def lit_ball(seed: int, size: int = SIZE) -> dict[str, Any]:
    """Layers of a ball under one lamp, with noise, and a label."""
    y, x = np.mgrid[0:size, 0:size] / size
    inside = np.hypot(x - 0.5, y - 0.5) < 0.35
    up = np.sqrt(np.clip(0.35**2 - (x - 0.5) ** 2 - (y - 0.5) ** 2, 0, None))
    normal = np.stack([x - 0.5, 0.5 - y, up], -1) / 0.35 * inside[..., None]
    shade = np.clip(normal @ np.array([0.5, 0.6, 0.62]), 0, None)[..., None]
    i_t = (3 * shade * np.array([0.7, 0.45, 0.2]) + 0.2 * y[..., None]).astype(np.float32)
    error = 0.02 * np.sqrt(i_t) + 0.001
    noise = rng(seed, "noise").normal(size=i_t.shape)
    return {"i_s": 0.4 * i_t, "i_t": np.abs(i_t + error * noise).astype(np.float32), "i_t_se": error,
            "mask": inside[..., None].astype(np.float32), "depth": np.where(inside, 3 - up, 0)[..., None],
            "normal": normal, "instance": (inside + 2.0 * ~inside)[..., None],
            "meta": {"key": f"{seed:08d}", "plan": {"camera": {"focal": 35.5}, "target": {"name": HOSTILE}},
                     "record": {"layers": [{"name": "i_s", "relative_error": 0.034},
                                           {"name": "i_t", "relative_error": 0.021}]}}}


def thumb(seed: int) -> str:
    """The data URI of a small picture."""
    colour = rng(seed, "thumb").uniform(0.2, 1, 3)
    stream = BytesIO()
    Image.fromarray(to_8bit(lit_ball(seed, 96)["i_t"] * colour, 0.6)).save(stream, "JPEG")
    return f"data:image/jpeg;base64,{b64encode(stream.getvalue()).decode()}"


def entries(count: int, thumbs: int = 8) -> list[dict[str, Any]]:
    """What the grid of a gallery says of examples; thumbs: how many different pictures there are."""
    draw, pictures = rng(0, "entries"), [thumb(seed) for seed in range(thumbs)]
    found = []
    for index in range(count):
        name, category = OBJECTS[draw.integers(len(OBJECTS))]
        level = int(draw.integers(len(LEVELS)))
        found.append({
            "key": f"{index:08d}", "split": "train" if index < 0.8 * count else "test",
            "scene": SCENES[draw.integers(2)], "object": name, "category": category, "light": int(draw.integers(2)),
            "lights": LAMPS[draw.integers(2)], "level": level, "level_name": LEVELS[level],
            "noise": 0.004 * level, "seconds": float(draw.lognormal(1.5, 0.5)) if index % 10 else None,
            "errors": {"i_t": float(draw.lognormal(-3.5, 0.4)), "i_s": float(draw.lognormal(-4, 0.4))},
            "thumb": pictures[index % thumbs]})
    return found


def gallery(count: int, base: str = "") -> dict[str, Any]:
    """What a gallery's page is made from."""
    rejected = [{"key": f"{count:08d}", "view": "train/0", "gate": "coverage", "open": False,
                 "reason": f"the object covers 0.4 % of the frame {HOSTILE}"}]
    return {"title": f"Made up {HOSTILE}", "about": {"name": "made-up", "width": SIZE, "height": SIZE},
            "layers": ["i_s", "i_t"], "examples": entries(count), "rejected": rejected, "base": base}
