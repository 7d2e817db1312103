"""What the daemon's repairs do with no one there: bounded in cost, and taken back where it made things worse."""
