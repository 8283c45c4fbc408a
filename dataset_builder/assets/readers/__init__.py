"""Readers of mesh files: a module for each format, whose `read` gives the whole file as a FileModel."""
