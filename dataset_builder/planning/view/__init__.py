"""What one view sees and what lights it: cameras, lights, daylight, colours."""
