"""Commands on what was accepted: show, devices, coverage, nodes, the lock."""
