"""The tables of the paper on a dataset at hand: one training per row, the measured row beside the printed one."""
