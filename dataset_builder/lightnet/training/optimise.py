"""One optimisation step: its rate, losses by phase, their gradients, and what is done where they are not finite."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, inf, isfinite, pi
from typing import Any

import torch

from dataset_builder.lightnet.data.batch import Batch, Prediction
from dataset_builder.lightnet.methods.method import Loss, Method
from dataset_builder.lightnet.settings import OptimiserSpec, TrainingSpec

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


@dataclass(frozen=True, kw_only=True)
class Taken:
    """What a step came to; fields as in `events.Stepped`."""

    loss: dict[str, float]
    terms: dict[str, float]
    norm: float
    rate: float
    skipped: str


class Optimisers:
    """Adam for each phase of a method."""

    def __init__(self, method: Method, spec: TrainingSpec):
        self._spec = spec
        self._parameters = {phase: [one for one in method.parameters_of(phase) if one.requires_grad]
                            for phase in method.phases}
        self._adams = {phase: torch.optim.Adam(parameters, lr=spec.optimiser.rate, betas=spec.optimiser.betas)
                       for phase, parameters in self._parameters.items()}

    def counts(self) -> dict[str, int]:
        """Trainable numbers by phase."""
        return {phase: sum(one.numel() for one in found) for phase, found in self._parameters.items()}

    def state(self) -> dict[str, Any]:
        """What `load` takes."""
        return {phase: adam.state_dict() for phase, adam in self._adams.items()}

    def load(self, state: dict[str, Any]) -> None:
        """Go on where `state` was taken."""
        for phase, adam in self._adams.items():
            adam.load_state_dict(state[phase])

    def step(self, method: Method, batch: Batch, prediction: Prediction, step: int) -> Taken:
        """Move the parameters of every phase in turn; from the first phase on that is not finite, none."""
        rate, norm, wrong = rate_at(step, self._spec.steps, self._spec.optimiser), 0.0, ""
        losses: dict[str, float] = {}
        terms: dict[str, float] = {}
        for phase in method.phases:
            loss = method.loss(phase, batch, prediction)
            numbers = [self._gradients(phase, loss), loss.total.detach(), *loss.terms.values()]
            # All at once, for each that is asked for waits until a GPU is done with everything before it
            here, losses[phase], *values = torch.stack(numbers).tolist()
            own = dict(zip(loss.terms, values, strict=True))
            terms |= own
            norm = max(norm, here) if isfinite(here) else here
            if wrong := _not_finite(phase, losses[phase], own, here):
                break
            self._move(phase, rate)
        return Taken(loss=losses, terms=terms, norm=norm, rate=rate, skipped=wrong)

    def _move(self, phase: str, rate: float) -> None:
        for group in self._adams[phase].param_groups:
            group["lr"] = rate
        self._adams[phase].step()

    def _gradients(self, phase: str, loss: Loss) -> torch.Tensor:
        """Gradients of a phase, clipped; their norm before, a scalar."""
        parameters = self._parameters[phase]
        for parameter in parameters:
            parameter.grad = None
        torch.autograd.backward(loss.total, inputs=parameters)
        clip = self._spec.optimiser.clip or inf
        return torch.nn.utils.clip_grad_norm_(parameters, clip)


def _not_finite(phase: str, total: float, terms: Mapping[str, float], norm: float) -> str:
    """What is wrong with a phase, if anything is."""
    if not isfinite(total):
        return f"{phase}: the loss is not finite ({', '.join(f'{name} {value:.4g}' for name, value in terms.items())})"
    if not isfinite(norm):
        return f"{phase}: the gradient is not finite, at a loss of {total:.4g}"
    return ""
