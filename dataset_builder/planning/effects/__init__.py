"""What a scene needs: decisions about features, depth, lights and guides, each with its reason."""
