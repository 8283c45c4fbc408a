"""Readers of posed photographs: the cameras of a file of another tool, and where their images are."""
