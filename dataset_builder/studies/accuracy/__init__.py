"""What accuracy costs in time: error against seconds for every setting that trades one for the other."""
