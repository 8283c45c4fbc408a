"""Building a dataset: units of work, what they are known by, and the memory of a build beside its dataset."""
