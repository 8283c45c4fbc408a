"""Layers that a dataset must have to learn from or to measure by, and what to do where it has none.

I_t is the truth: it shows the clean mesh under the target light. Captures have no clean mesh, so that their examples
have no `i_t`.
"""

from collections.abc import Collection, Sequence

from dataset_builder.errors import Problem

TRUTH = "i_t"
NO_TRUTH = ("i_t is the truth: build the dataset with it, and where its objects are captures, which have none, use "
            "`dataset-builder compose` instead")


def problem_of(where: str, there: Collection[str], needed: Sequence[str], what: str) -> Problem | None:
    """What is wrong where not all of the `needed` layers are `there`; None where nothing is. what: they are needed to
    do."""
    missing = [name for name in needed if name not in there]
    if not missing:
        return None
    rule = f"expected {', '.join(needed)} to {what}, the dataset has no {', '.join(missing)}"
    return Problem(where=where, path="layers", rule=rule,
                   hint=NO_TRUTH if TRUTH in missing else "build it with these layers")
