"""The state file of a host: journal, snapshot and lock, and the one face for whoever changes it."""
