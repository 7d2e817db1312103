"""Commands on the daemon: watch, status, health, repairs, claims, incidents."""
