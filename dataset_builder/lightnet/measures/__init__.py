"""Measures of pictures over the object, shared by losses and metrics."""
