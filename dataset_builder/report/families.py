"""The embedded furniture, as tables of parameters."""

from rich.table import Table

from dataset_builder.errors import UserError
from dataset_builder.spec.families import FAMILIES
from dataset_builder.spec.model import Model


def family_tables(name: str | None) -> list[Table]:
    """One overview, or the parameters of one family. Raises UserError for a family that is not there."""
    if name is None:
        table = Table("family", "what", "parameters")
        for family in FAMILIES.values():
            table.add_row(family.name, family.summary, ", ".join(param.name for param in family.params))
        return [table]
    if name not in FAMILIES:
        raise UserError(f"family: expected one of {', '.join(FAMILIES)}, got {name}")
    table = Table("parameter", "unit", "limits", "drawn from", "meaning", title=FAMILIES[name].summary)
    for param in FAMILIES[name].params:
        drawn = param.default.model_dump(mode="json") if isinstance(param.default, Model) else param.default
        table.add_row(param.name, param.unit, f"{param.low:g} to {param.high:g}", str(drawn), param.meaning)
    return [table]
