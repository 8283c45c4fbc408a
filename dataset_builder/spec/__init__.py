"""Spec files as frozen models with every rule checked; only `load` reads YAML."""
