"""The study's conclusions: one sentence for each question with its numbers, and recommended settings."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from dataset_builder.studies.accuracy.curves import Point


@dataclass(kw_only=True)
class Advice:
    """sentences: by question. overrides: as `--set` takes them. marked: recommended point by question and layer.
    noise: relative error of each layer at its recommended point."""

    sentences: dict[str, str] = field(default_factory=dict)
    overrides: list[str] = field(default_factory=list)
    marked: dict[tuple[str, str], Point] = field(default_factory=dict)
    noise: dict[str, float] = field(default_factory=dict)

    def lines(self) -> str:
        """One option of the command line for every override."""
        return "".join(f"--set '{override}'\n" for override in self.overrides)

    def marks(self, question: str) -> Mapping[str, Point]:
        """Recommended points of a question by layer."""
        return {layer: point for (name, layer), point in self.marked.items() if name == question}
