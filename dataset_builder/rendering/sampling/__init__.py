"""Monte Carlo means with honest errors, and where further samples go."""
