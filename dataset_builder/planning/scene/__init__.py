"""Positions and contents: objects and scenes of a split, the space that a room or a scene leaves, layout in it, and
the assets that a plan names."""
