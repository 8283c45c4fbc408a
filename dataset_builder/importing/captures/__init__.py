"""Posed photographs of an object: read from what other tools write, checked, undistorted, and put upright in metres."""
