"""Whether simulating only what a scene needs changes a picture by more than stated, and the time it saves."""
