"""Access to the endpoint: tokens, tunnel, limits, rights, and its audit log."""
