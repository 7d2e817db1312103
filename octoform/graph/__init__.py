"""The desired graph: what must be true, on any machine, for a manifest and its specs to be in force."""
