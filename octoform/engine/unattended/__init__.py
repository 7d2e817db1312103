"""What the daemon's repairs do with nobody there: bounded in cost, and taken back where it made things worse."""
