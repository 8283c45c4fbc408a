"""What a scene calls for: decisions about features, depth, lights and guides, each with its reason."""
