"""How rough meshes are made, as written."""

from math import inf
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, Tag

from dataset_builder.spec.model import Model
from dataset_builder.spec.numbers import AnyNumber, branches, check_within, within


def _one_or_many(value: Any) -> str:
    return "|levels" if isinstance(value, (list, tuple)) else "|level"


Sigma = Annotated[AnyNumber, AfterValidator(lambda number: check_within(number, 0, inf))]
Levels = Annotated[
    Annotated[Sigma, Tag("|level")] | Annotated[tuple[Sigma, ...], Field(min_length=1), Tag("|levels")],
    branches(_one_or_many, "expected a number or a list of numbers"),
]
"""One noise level or several."""


class RoughSpec(Model):
    """How rough meshes are made."""

    sigma: Levels = 0.004
    """Standard deviation of vertex noise in bounding-sphere radii; a list gives several noise levels, each as a
    separate example."""
    edge_length: within(low=1e-4) = 0.04  # type: ignore[valid-type]
    """Target edge length in metres."""
    rounds: Annotated[int, Field(ge=0, le=6)] = 1
    """Loop rounds; edges are split to `edge_length * 2**rounds` before."""
    crease_angle: Annotated[float, Field(ge=0, le=180)] = 30.0
    """Edges whose faces meet at more than this angle, in degrees, stay sharp."""
    direction: Literal["isotropic", "normal"] = "isotropic"
    """Vertices move independently along each axis, or along their normal only."""

    @property
    def levels(self) -> tuple[AnyNumber, ...]:
        """The noise levels, one or more."""
        return self.sigma if isinstance(self.sigma, tuple) else (self.sigma,)
