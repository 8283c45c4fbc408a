"""From shards to batches: reading, cropping, augmentation and exposure."""
