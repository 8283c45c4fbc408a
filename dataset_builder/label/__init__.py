"""What every example says of itself, as frozen models: its plan and what was found while it was rendered; no code."""
