"""The daemon: status, health, incidents, claims, its actions and a person's orders to it."""
