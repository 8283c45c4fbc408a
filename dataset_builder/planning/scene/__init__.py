"""What stands where: contents of a split, layout of a room, and the assets that a plan names."""
