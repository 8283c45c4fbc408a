"""Fields on one backend, in a process of its own: a ball fitted twice, and splats along rays.

    python -m tests.gpu.field_side BACKEND OUT.npz
"""

import json
import sys
from pathlib import Path

import numpy as np

from dataset_builder.assets.field_file import encode
from dataset_builder.digest import sha256_bytes
from dataset_builder.rendering import plugins
from dataset_builder.rendering.backend import activate
from dataset_builder.rendering.field.splat_look import splat_sight
from dataset_builder.rendering.field.splat_mesh import seen_along
from tests.assets.splat_files import random_cloud
from tests.rendering.field.ball_views import ball_images, fitted, sphere_directions

RAYS = 2000


def main(backend: str, out: Path) -> None:
    """Fit, look, and write what was found."""
    activate(backend)
    plugins.register()
    images, held_out = (ball_images(sphere_directions(count, turn=turn)) for count, turn in ((48, 0.0), (8, 1.0)))
    files = [fitted(images, held_out) for _ in range(2)]
    figures = {name: [float(getattr(file.record, name)) for file in files]
               for name in ("psnr", "opacity_iou", "silhouette_iou", "loss")}
    rng = np.random.default_rng(7)
    origins = rng.normal(size=(RAYS, 3))
    origins *= 4 / np.linalg.norm(origins, axis=1, keepdims=True)
    ways = rng.uniform(-0.5, 0.5, size=(RAYS, 3)) - origins
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    light, opacity, depth = seen_along(splat_sight(random_cloud(300), np.zeros(3), 2.0), origins, ways)
    np.savez(out, light=light, opacity=opacity, depth=depth,
             figures=np.array(json.dumps(figures | {"digests": [sha256_bytes(encode(file)) for file in files]})))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
