"""A method by formula, so that tests know what it predicts."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal

import torch
from torch import nn

from dataset_builder.lightnet.data.batch import Batch, Inputs, Prediction
from dataset_builder.lightnet.methods.checkpoint import Trained, build_method, save_state
from dataset_builder.lightnet.methods.method import Loss, Method
from dataset_builder.lightnet.settings import TrainingSpec

Formula = Callable[[Inputs], torch.Tensor]


class FormulaMethod(Method):
    """Says `formula` of its inputs, inside the object; needs multiples of 8."""

    def __init__(self, formula: Formula):
        super().__init__()
        self.multiple, self.formula = 8, formula
        self.weight = nn.Parameter(torch.zeros(7))

    def forward(self, inputs: Inputs) -> Prediction:
        return Prediction(i_t=self.formula(inputs) * inputs.inside)

    def loss(self, phase: str, batch: Batch, prediction: Prediction) -> Loss:
        return Loss(total=prediction.i_t.sum(), terms={})


def product(inputs: Inputs) -> torch.Tensor:
    """I_s S'."""
    return inputs.i_s * inputs.s_prime


def trained(formula: Formula = product, *, spec: TrainingSpec | None = None, dataset: str = "elsewhere") -> Trained:
    """The method as if read from a checkpoint."""
    return Trained(method=FormulaMethod(formula).eval(), spec=spec or TrainingSpec(), step=5, dataset=dataset,
                   off=(), device=torch.device("cpu"))


def write_checkpoint(path: Path, *, method: Literal["lightnet", "dpr"] = "lightnet", dataset: str = "elsewhere",
                     **data: float) -> Path:
    """A checkpoint of an untrained method of the least size; data: values of the spec's `data`."""
    spec = TrainingSpec.model_validate({"method": method, "model": {"width": 4, "downs": 2}, "data": data})
    bare = build_method(spec.model_copy(update={"objective": spec.objective.model_copy(update={"fr": 0.0})}))
    save_state(path, {"spec": spec.model_dump_json(), "identity": "", "dataset": dataset, "step": 3,
                      "method": bare.state_dict(), "optimisers": {}, "history": [{"step": 3.0, "psnr": 12.5}],
                      "best": [3, 12.5], "stale": 0, "bad_steps": 0, "off": ["fr is off"]})
    return path
