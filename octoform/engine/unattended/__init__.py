"""Unattended repairs of the daemon: bounded in cost, and rolled back where they made things worse."""
