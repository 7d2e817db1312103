"""The daemon: status, health, incidents, claims, what it does and what a person tells it."""
