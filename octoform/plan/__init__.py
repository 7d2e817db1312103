"""Plan: what would be done and why, as a pure function of desired graph, prior state and observed host."""
