"""The tables of the paper on a dataset at hand: one training per row, measured rows beside printed ones."""
