"""Files of a folder, here or at an address: whole, by ranges, and again when that fails."""
