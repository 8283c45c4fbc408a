"""How smooth a rough mesh must be: one dataset at several noise levels, and LighTNet trained on them."""
