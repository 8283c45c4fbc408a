"""Geometry, lights and cameras of a plan as a Mitsuba scene of constant structure."""
