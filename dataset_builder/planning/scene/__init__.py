"""Positions and contents: objects and scenes of a split, layout of a room, and the assets that a plan names."""
