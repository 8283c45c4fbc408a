"""The base of every model of a spec: frozen, no unknown keys, finite numbers, field names as written in YAML."""

from pydantic import BaseModel, ConfigDict
from pydantic_core import PydanticCustomError


class Model(BaseModel):
    """Base of every spec and plan model."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)


def broken(rule: str, *, path: tuple[str | int, ...] = (), known: tuple[str, ...] = ()) -> PydanticCustomError:
    """The error of a broken rule: `path` leads from the validated value to the culprit, `known` are the right names."""
    return PydanticCustomError("broken", "{rule}", {"rule": rule, "path": path, "known": known})
