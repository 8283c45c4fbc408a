"""An example of a dataset -> a USD stage that other programs open: prims of all that its plan places, lights, camera."""
