"""LighTNet and its rivals: reads finished shards, trains, evaluates, composes. The only folder that imports PyTorch."""
