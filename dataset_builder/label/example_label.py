"""The label of an example as a whole: what its JSON member holds."""

from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.record import RenderRecord
from dataset_builder.spec.model import Model


class LayerStatistics(Model):
    """Values of one layer as they are stored, over all pixels and channels."""

    min: float
    """Least."""
    max: float
    """Largest."""
    mean: float
    """Mean, to six digits."""


class ExampleLabel(Model):
    """What `<key>.json` holds. No key is ever null; numbers with a fraction always have a decimal point."""

    schema_version: str
    """Of the label's keys: `1`."""
    key: str
    """Eight digits, unique over all splits."""
    index: int
    """Place in the dataset over all splits, from 0."""
    split: str
    """Split that the example belongs to."""
    plan: ExamplePlan
    """Every number that the example was made from."""
    record: RenderRecord
    """What was found on the way."""
    layers: dict[str, LayerStatistics]
    """Values of each layer, by its name."""
