"""Who may reach and call the endpoint: tokens, tunnel, limits, rights, and the audit log of it."""
