"""A folder of models to specs: found, looked at, named, and written as object files and a dataset of them."""
