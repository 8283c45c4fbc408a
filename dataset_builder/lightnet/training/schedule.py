"""The learning rate as a pure function of the step: nothing about it needs to be kept for resuming."""

from math import cos, pi

from dataset_builder.lightnet.settings import OptimiserSpec

LAST = 0.01
"""Share of the rate that a cosine schedule ends at."""


def rate_at(step: int, steps: int, spec: OptimiserSpec) -> float:
    """Learning rate of step 0, 1, .. steps - 1: a linear rise over `warm_up` steps, then constant or half a cosine.

    >>> rate_at(0, 100, OptimiserSpec(rate=1.0, warm_up=10, schedule="constant"))
    0.1
    """
    if step < spec.warm_up:
        return spec.rate * (step + 1) / spec.warm_up
    if spec.schedule == "constant":
        return spec.rate
    done = (step - spec.warm_up) / max(steps - 1 - spec.warm_up, 1)
    return spec.rate * (LAST + (1 - LAST) * (1 + cos(pi * min(done, 1.0))) / 2)
