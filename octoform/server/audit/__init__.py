"""The log that nobody can change unseen."""
