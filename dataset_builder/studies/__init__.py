"""What settings cost and bring, measured with ordinary builds, renderings and trainings."""
