"""From shards to batches: what is read, cut, varied and exposed before a network sees it."""
