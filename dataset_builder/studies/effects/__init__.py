"""Whether simulating only what a scene calls for changes a picture by more than it may, and the time that it saves."""
