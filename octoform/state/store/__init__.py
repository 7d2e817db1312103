"""The state file of a host: journal, snapshot and lock, and the one face for anyone who changes it."""
