"""The base of every part of octoform: the standard library alone, and nothing that knows what a host is.

Copied into each endpoint's folder beside the launcher, so that the process which guards the devices reads and writes
its files in the same way as the core.
"""
