"""Scene files to scene models: a file for each kind of source."""
