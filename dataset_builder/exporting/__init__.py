"""An example of a dataset -> a USD stage that other programs open: all that its plan places, lights and camera."""
