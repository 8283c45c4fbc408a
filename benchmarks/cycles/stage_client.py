"""Exported stages in Blender: one variant at a time."""

from pathlib import Path
from typing import Any

from .client import Blender, CyclesImage

SIDE = Path(__file__).with_name("blender_stage.py")
OVERLAY = """#usda 1.0
(
    defaultPrim = "Example"
    metersPerUnit = 1
    upAxis = "Z"
    subLayers = [@{stage}@]
)

over "Example" (
    variants = {{
        string illumination = "{illumination}"
    }}
)
{{
    over "Target" (
        variants = {{
            string geometry = "{geometry}"
        }}
    )
    {{
    }}
}}
"""


class StageViewer(Blender):
    """A Blender process that opens stages."""

    def __init__(self, python: Path, threads: int):
        super().__init__(python, threads, SIDE)

    def open(self, stage: Path, *, illumination: str, geometry: str, width: int, height: int,
             bounces: int) -> dict[str, Any]:
        """What Blender makes of a stage in these variants, which a layer of its own chooses."""
        chosen = Path(self._folder.name) / f"{illumination}-{geometry}.usda"
        chosen.write_text(OVERLAY.format(stage=stage.resolve().as_posix(), illumination=illumination,
                                         geometry=geometry))
        return self.ask(do="open", path=str(chosen), width=width, height=height, bounces=bounces)

    def picture(self, spp: int, seed: int = 1) -> CyclesImage:
        """What the camera of the stage sees."""
        return self.render(spp=spp, seed=seed)
