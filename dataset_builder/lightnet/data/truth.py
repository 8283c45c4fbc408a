"""Layers that a dataset must have to learn from or to measure by, and what to do where it has none.

I_t is the truth: it shows the clean mesh under the target light. Captures have no clean mesh, so that their examples
have no `i_t`.
"""

from collections.abc import Collection, Sequence

from dataset_builder.errors import Problem
from dataset_builder.shards.manifest import Manifest

TRUTH, ERROR = "i_t", "i_t_se"
HINTS = {"i_t_se": "build it with --set storage.standard_errors=true, or set objective.noise to plain",
         "i_t_half": "build it with i_t_half among its layers, or set objective.noise to plain"}
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
                   hint=NO_TRUTH if TRUTH in missing else HINTS.get(missing[0], "build it with these layers"))


def noise_unknown(manifest: Manifest) -> str:
    """Why nobody knows the noise of a dataset's truth; empty where standard errors of every pixel tell it.

    A label's relative error is no substitute: it says nothing of where on an object noise is.
    """
    if TRUTH in {item.layer for item in manifest.denoised}:
        return "i_t is denoised, and standard errors are those of before"
    if ERROR not in {layer.name for layer in manifest.layers}:
        return f"the dataset has no {ERROR}: build it with --set storage.standard_errors=true"
    return ""


def noise_layers(manifest: Manifest) -> tuple[str, ...]:
    """Layers that tell the noise of the truth; none where it is not known."""
    return () if noise_unknown(manifest) else (ERROR,)
