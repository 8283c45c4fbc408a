"""One mesh file as this builder shows it: albedo and mask of an example that has it for its target."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from importers.comparison import Picture

from dataset_builder.api import load_spec, plan, render_example
from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.geometry.pinhole import look_at
from dataset_builder.planning.scene.assets_of_plan import world_from_object

METRES = 0.8
"""Longest side that every model is brought to."""
SPEC = """\
name: model
seed: 1
image: {{width: {size}, height: {size}}}
layers: {{d: object, mask: object}}
render: {{spp: {spp}}}
rough: {{sigma: 0, edge_length: 1, rounds: 0}}
camera: {{azimuth: {azimuth}, elevation: 30, fov: 30, coverage: [0.001, 0.95]}}
gates: {gates}
source: {{dome: 1}}
splits:
  - name: train
    objects: {{count: 1, from: [object.yaml]}}
    scenes: {{count: 1, from: [scene.yaml]}}
"""
FILES = {"room.yaml": "width: 12\ndepth: 12\nheight: 4\nwindows: 0\nskirting: 0\n", "scene.yaml": "room: room.yaml\n"}
MATTE = '{"*": {specular: 0, coat: 0, sheen: [0, 0, 0]}}'
"""Leaves base colour times (1 - metallic) as the albedo."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OurPicture:
    """A picture, and what another renderer needs to take the same one."""

    picture: Picture
    extents: list[float]
    """Of the model as it stands, metres; it is centred over the origin and stands on z = 0."""
    camera: dict[str, Any]
    """`position`, `axes` (rows right, up, forward) and `fov` in degrees, in the model's frame."""


def our_picture(path: Path, folder: Path, *, size: int, spp: int, azimuth: float) -> OurPicture:
    """Render `path`; specs are written into `folder`. Raises UserError where the builder refuses the file."""
    low, high = load_mesh_file(path, name="model", category="object", licence="CC0-1.0").mesh.bounds
    sides = high - low
    scale = METRES / float(sides.max())
    made = {**FILES, "model.yaml": SPEC.format(size=size, spp=spp, azimuth=azimuth, gates="{mask_overlap: 0}"),
            "object.yaml": f"file: {str(path.resolve())!r}\nlicence: CC0-1.0\ncategory: object\nscale: {scale!r}\n"
                           f"materials: {MATTE}\n"}
    for name, content in made.items():
        (folder / name).write_text(content)
    spec = load_spec(folder / "model.yaml")
    found = plan(spec, 0)
    layers = render_example(spec, found)
    to_model = np.linalg.inv(world_from_object(found.target))
    eye, aim = (to_model[:3, :3] @ np.array(point) + to_model[:3, 3] for point in (found.camera.position,
                                                                                  found.camera.target))
    picture = Picture(albedo=layers["d"], mask=layers["mask"][..., 0], extents=sides)
    return OurPicture(picture=picture, extents=(scale * sides).tolist(),
                      camera={"position": eye.tolist(), "axes": look_at(eye, aim).tolist(), "fov": found.camera.fov})
