"""A call while it runs: threads, the watchdog, the lock of a bus, the size of a result."""
