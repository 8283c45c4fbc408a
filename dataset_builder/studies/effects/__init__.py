"""Whether simulating only what a scene calls for changes a picture by more than stated, and the time it saves."""
