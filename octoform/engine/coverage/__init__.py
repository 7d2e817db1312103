"""How much of a host's hardware can be used, and whether each run says the same."""
