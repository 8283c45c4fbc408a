"""What every example says of itself, as frozen models: its plan and the record of its making; plain data, no code."""
