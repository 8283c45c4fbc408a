"""What two splits of a dataset have in common, where a spec lets them."""

from typing import Literal

from pydantic import Field

from dataset_builder.spec.model import Model


class SharedContent(Model):
    """Objects, or scenes, that are in two splits."""

    what: Literal["objects", "scenes"]
    """Objects of one shape count as one, whatever their materials are."""
    splits: tuple[str, str]
    """The two, in the order of the spec."""
    count: int = Field(ge=1)
    """How many both have."""
    of: tuple[int, int]
    """How many different ones each has."""
    whole: bool = False
    """Whether numbers are of the whole dataset where this is a subset of it, which may hold less."""

    @property
    def sentence(self) -> str:
        """What that means for figures."""
        first, second = self.splits
        noun = self.what if self.count > 1 else self.what.removesuffix("s")
        head = "in the whole dataset, " if self.whole else ""
        return (f"{head}splits {first} and {second} share {self.count} {noun} ({first} has {self.of[0]}, {second} "
                f"{self.of[1]}): figures on {second} of what was trained on {first} say how well a method does on "
                f"{self.what} that it knows, not on new ones")
