"""What people write, as frozen models with every rule checked; YAML is read in `load` alone."""
