"""The training loop and its parts; what it trains comes from `methods`, what it reads from `data`."""
