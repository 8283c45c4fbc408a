"""Layers to files and back: members, shards, manifest, reading and verification."""
