"""What a dataset says of itself whose examples were chosen from those of another."""

from dataset_builder.shards.shard_index import Count
from dataset_builder.spec.model import Model


class Asked(Model):
    """What was asked for when examples were chosen: patterns by kind, of which one had to match; none match all."""

    split: tuple[str, ...] = ()
    scene: tuple[str, ...] = ()
    object: tuple[str, ...] = ()
    category: tuple[str, ...] = ()
    level: tuple[str, ...] = ()
    """Numbers or names of noise levels."""
    light: tuple[str, ...] = ()
    """Numbers of target lights among those of a view."""
    layers: tuple[str, ...] = ()
    count: Count = 0
    """The first so many of every split that match all else; 0 for all."""


class SubsetRecord(Model):
    """Which dataset this one was chosen from. Keys, labels and bytes of layers are as they are there."""

    name: str
    version: str
    sha256: str
    """Of its `dataset.json`."""
    examples: Count
    """How many it has."""
    asked: Asked

    @property
    def choice(self) -> str:
        """What was asked for, in words that a command takes."""
        plain = self.asked.model_dump(exclude={"layers", "count"}, exclude_defaults=True)
        words = [f"--{kind} {pattern}" for kind, patterns in plain.items() for pattern in patterns]
        words += [f"--layers {','.join(self.asked.layers)}"] if self.asked.layers else []
        return " ".join([*words, *([f"--count {self.asked.count}"] if self.asked.count else [])])
