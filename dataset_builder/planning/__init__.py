"""A spec becomes plans: every number drawn, every decision made and explained, nothing rendered."""
