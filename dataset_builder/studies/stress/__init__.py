"""Hard cases, each an expectation that can fail: a file for each kind, and the bench that renders them."""
