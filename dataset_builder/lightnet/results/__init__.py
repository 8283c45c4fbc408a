"""Results of trained methods on held-out examples: scores, means, composites and pictures."""
