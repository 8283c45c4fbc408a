"""The release gate: statistics over a whole dataset, its loader, and a short training."""
