"""LighTNet and its baselines: reads finished shards, trains, evaluates, composes. PyTorch: here and in `release`."""
