"""Plan: what is desired, what is there, and what differs."""
