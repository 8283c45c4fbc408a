"""Building a dataset: units of work, their digests, and the state of a build that is kept beside its dataset."""
