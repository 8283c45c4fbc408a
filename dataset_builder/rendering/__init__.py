"""Plans become layers: passes of a view and their results; Mitsuba and Dr.Jit are imported here alone."""
