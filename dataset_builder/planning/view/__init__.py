"""One view: its camera, lights, daylight and their colours."""
