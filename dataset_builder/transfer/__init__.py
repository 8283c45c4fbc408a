"""Datasets between places: pulled, pushed, mended."""
