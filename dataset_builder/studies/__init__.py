"""Cost and benefit of settings, measured with ordinary builds, renderings and trainings."""
