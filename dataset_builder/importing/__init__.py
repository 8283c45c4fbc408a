"""Folders of models, or of 3D-FRONT scenes, to specs: found, looked at, named, and written with a dataset of them."""
