"""Units of work: the examples of one view, which share camera, scene and every light-free layer."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby

from dataset_builder.planning.catalogue import ExampleRef, ViewRef


@dataclass(frozen=True, kw_only=True)
class ViewUnit:
    """One view and those of its examples that are asked for, in order of index; never empty."""

    view: ViewRef
    examples: tuple[ExampleRef, ...]

    @property
    def lights(self) -> tuple[int, ...]:
        """Distinct target lights among the examples, ascending."""
        return tuple(sorted({example.light for example in self.examples}))

    @property
    def levels(self) -> tuple[int, ...]:
        """Distinct noise levels among the examples, ascending."""
        return tuple(sorted({example.level for example in self.examples}))


def units(examples: Iterable[ExampleRef]) -> tuple[ViewUnit, ...]:
    """Group examples, of all splits or of a selection, by view; units come in the order of their first index."""
    ordered = sorted(examples, key=lambda example: example.index)
    return tuple(ViewUnit(view=view, examples=tuple(group))
                 for view, group in groupby(ordered, key=lambda example: example.view))
