"""Configurations of trainings that are derived from one that a user gave."""

from collections.abc import Mapping
from typing import Any

from dataset_builder.errors import UserError
from dataset_builder.lightnet.methods.device import choose
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.processes import cores


def base_of(spec: TrainingSpec) -> TrainingSpec:
    """What all rows of a table share: the configuration, trained to its last step.

    Training that stops early would show rows different numbers of examples, and look at what it is measured on. Raises
    UserError where the configuration is not one of LighTNet.
    """
    if spec.method != "lightnet":
        raise UserError(f"method: expected a configuration of lightnet, from which the rows are derived, got "
                        f"{spec.method}")
    return changed(spec, check={"patience": 0})


def changed(spec: TrainingSpec, **values: Any) -> TrainingSpec:
    """The same with other values, checked again; a mapping changes those values of a part that it names.

    >>> changed(TrainingSpec(), steps=7, model={"width": 4}).model
    ModelSpec(width=4, downs=4, formulation='dr_alpha_s', shading='residual')
    """
    plain: dict[str, Any] = spec.model_dump()
    for key, value in values.items():
        plain[key] = {**plain[key], **value} if isinstance(value, Mapping) else value
    return TrainingSpec.model_validate(plain)


def settings_of(spec: TrainingSpec, device: str, seeds: int = 1) -> str:
    """One sentence on how LighTNet is trained. device: as `lightnet.methods.device.choose` takes it."""
    found = choose(device)
    where = f"{cores()} cores" if found.type == "cpu" else str(found)
    which = f"{seeds} seeds" if seeds > 1 else f"seed {spec.seed}"
    return (f"width {spec.model.width}, {spec.steps} steps of {spec.data.batch} examples, crops of {spec.data.crop} "
            f"pixels, {which}, {where}: not the paper's run")
