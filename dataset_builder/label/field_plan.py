"""The plan of a field: how what an object is seen through, or its rough mesh taken from, is made."""

from typing import Literal

from dataset_builder.label.scene_plan import IlluminationPlan
from dataset_builder.spec.model import Model


class FieldPlan(Model):
    """A field of an object, alone in its own frame. Unused fields are 0."""

    kind: Literal["none", "density", "sdf", "own"] = "none"
    """`none`: there is none, the clean mesh is what is seen, or made rough. `density`, `sdf`: volume density or signed
    distance, fitted to images of the clean mesh. `own`: the file of the object is a field already."""
    views: int = 0
    """Images that it is fitted to."""
    held_out: int = 0
    """Images that it is measured on."""
    size: int = 0
    """Width and height of the images, pixels."""
    spp: int = 0
    """Samples per pixel of the images."""
    resolution: int = 0
    """Cells along a side of its grid."""
    steps: int = 0
    """Of the fit."""
    max_depth: int = 0
    """Longest path of the images in edges."""
    seed: str = "0"
    """Decimal 64-bit seed of directions, images and fit."""
    light: IlluminationPlan = IlluminationPlan(lights=(), open=())
    """The source light that the images are taken in, in the object's frame, with nothing around that could block
    it."""

    @property
    def there(self) -> bool:
        """Whether there is one."""
        return self.kind != "none"

    @property
    def made(self) -> bool:
        """Whether it is made from the clean mesh."""
        return self.kind not in ("none", "own")


NO_FIELD = FieldPlan()
