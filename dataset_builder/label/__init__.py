"""The label of an example as frozen models: its plan and the record of how it was rendered; no code."""
