"""Hard cases, each with a bound that can fail: a file for each kind, and the bench that renders them."""
