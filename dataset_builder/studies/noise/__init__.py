"""How smooth a rough mesh must be: one dataset at several noise levels, LighTNet trained on all of them and on each."""
