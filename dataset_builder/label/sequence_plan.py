"""The place of a view among those of a pair that follow each other."""

from dataset_builder.spec.model import Model


class SequencePlan(Model):
    """The views of a path in order; empty for a view that follows no other."""

    name: str = ""
    """Of the sequence, unique over the dataset: `turn-00-03`, split, object and scene; empty for none. Its examples
    under another light or at another noise level are sequences of their own."""
    frame: int = 0
    """Place in it, from 0; neighbours differ by 1."""
    frames: int = 0
    """How many there are, those included that could not be made; 0 for none."""

    def example_name(self, light: int, level: int) -> str:
        """Name of the sequence of examples under one light, at one noise level: `turn-00-03-0-0`."""
        return f"{self.name}-{light}-{level}"
