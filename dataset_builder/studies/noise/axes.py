"""What the study of noise may draw its curves over: every figure that labels have of a rough mesh."""

from dataclasses import dataclass

from dataset_builder.errors import UserError
from dataset_builder.label.example_label import RenderRecord

DEFAULT, NORMALS, SHADING = "roughness_rms", "normal_median", "s_relmse"


@dataclass(frozen=True, kw_only=True)
class NoiseAxis:
    """One measured figure of labels."""

    name: str
    """Its key in the label."""
    text: str
    """What it is called along an axis, with its unit."""
    short: str = ""
    """What it is called in tables, its key with spaces where nothing is said."""
    factor: float = 1.0
    """From the label's unit to that of `text`."""

    @property
    def heading(self) -> str:
        """What it is called in tables."""
        return self.short or self.name.replace("_", " ")

    def value(self, record: RenderRecord) -> float:
        """The figure of an example. Raises UserError where its label has none."""
        if not (values := self._found(record)):
            raise UserError(f"--x: expected labels with {self.name}, got one without; build the dataset again, or take "
                            f"{DEFAULT}")
        return values[0]

    def known(self, record: RenderRecord) -> bool:
        """Whether an example's label has the figure."""
        return bool(self._found(record))

    def _found(self, record: RenderRecord) -> tuple[float, ...]:
        """The figure, or none."""
        holders = (record, *record.roughness)
        found = next((getattr(holder, self.name) for holder in holders if hasattr(holder, self.name)), ())
        return found if isinstance(found, tuple) else (float(found),)

    def shown(self, value: float) -> str:
        """A figure in the unit of `text`, to three digits."""
        return f"{self.factor * value:.3g}{' %' if self.factor == PER_CENT else ''}"


PER_CENT, RADII = 100.0, "% of the bounding radius"
AXES = {axis.name: axis for axis in (
    NoiseAxis(name=DEFAULT, text=f"measured roughness, rms, {RADII}", short="roughness", factor=PER_CENT),
    NoiseAxis(name="roughness_max", text=f"largest distance of a vertex, {RADII}", factor=PER_CENT),
    NoiseAxis(name="to_clean_rms", text=f"distance to the clean mesh, rms, {RADII}", factor=PER_CENT),
    NoiseAxis(name="to_clean_95", text=f"distance to the clean mesh, 95th percentile, {RADII}", factor=PER_CENT),
    NoiseAxis(name="to_rough_rms", text=f"distance from the clean mesh, rms, {RADII}", factor=PER_CENT),
    NoiseAxis(name="to_rough_95", text=f"distance from the clean mesh, 95th percentile, {RADII}", factor=PER_CENT),
    NoiseAxis(name="normal_median", text="deviation of normals, median, degrees"),
    NoiseAxis(name="normal_95", text="deviation of normals, 95th percentile, degrees"),
    NoiseAxis(name="volume", text="volume, rough : clean"),
    NoiseAxis(name="area", text="area, rough : clean"),
    NoiseAxis(name="extent_x", text="extent along x, rough : clean"),
    NoiseAxis(name="extent_y", text="extent along y, rough : clean"),
    NoiseAxis(name="extent_z", text="extent along z, rough : clean"),
    NoiseAxis(name="flipped", text="flipped faces, %", factor=PER_CENT),
    NoiseAxis(name="spectrum_slope", text="slope of the spectrum of displacements"),
    NoiseAxis(name="silhouette_iou", text="silhouettes, intersection over union"),
    NoiseAxis(name="s_relmse", text="S' against S, relative MSE"),
)}
"""By their names."""


def axis_of(name: str) -> NoiseAxis:
    """The axis of a name. Raises UserError that lists all where it is none."""
    if name not in AXES:
        raise UserError(f"--x: expected one of {', '.join(AXES)}, got {name or 'nothing'}")
    return AXES[name]


def figures(record: RenderRecord, needed: NoiseAxis) -> dict[str, float]:
    """All figures of an example that its label has, by name. Raises UserError where it lacks the one needed."""
    return {needed.name: needed.value(record), **{axis.name: axis.value(record) for axis in AXES.values()
                                                  if axis.known(record)}}
