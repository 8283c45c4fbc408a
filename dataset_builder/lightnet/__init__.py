"""LighTNet and its rivals: reads finished shards, trains, evaluates, composes; PyTorch lives here and in `release`."""
