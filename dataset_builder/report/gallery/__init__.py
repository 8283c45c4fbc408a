"""Examples of a dataset as pages: all of them to browse, or one at full size."""
