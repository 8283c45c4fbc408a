"""Furniture and rooms made in code, one file for each kind of piece or what pieces share."""
