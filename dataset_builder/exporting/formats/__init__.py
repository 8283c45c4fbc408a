"""Datasets in formats of others: a file each, which knows how a shard of ours becomes files of theirs."""
