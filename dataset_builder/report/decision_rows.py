"""Decisions about an example as rows of a table, for the terminal and for pages."""

from dataset_builder.label.example_plan import ExamplePlan


def decision_rows(plan: ExamplePlan) -> list[tuple[str, str, str]]:
    """Effect, choice and reason of every decision about an example, then its notes."""
    decided = [(each.effect, each.choice, each.reason) for each in plan.effects.decisions
               if each.effect != "scene file" or each.choice == "taken away"]
    return decided + [("note", "", note) for note in plan.notes]
