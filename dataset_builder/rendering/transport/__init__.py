"""Light paths: the integrators, the path tracer, fog, and light samples."""
