"""The daemon's stored state over its restarts: each kind in a file of its own, written whole or appended to."""
