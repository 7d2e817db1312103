"""The log that no one can change unseen."""
