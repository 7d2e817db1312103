"""What the daemon remembers over its own restarts: each kind in a file of its own, written whole or appended to."""
