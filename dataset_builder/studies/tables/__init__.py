"""The paper's tables on your own dataset: one training per row, measured rows beside published ones."""
