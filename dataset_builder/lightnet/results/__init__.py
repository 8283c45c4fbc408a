"""What trained methods make of held-out examples: scores, means, composites and pictures."""
