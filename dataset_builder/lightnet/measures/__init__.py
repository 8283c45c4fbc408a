"""Figures of pictures over the object, as losses and metrics share them."""
