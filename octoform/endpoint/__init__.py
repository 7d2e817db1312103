"""The live server: its environment, its launcher, its check and its clients.

Import the modules directly; ``environment`` and ``observing`` are light enough for a plan that has nothing to do,
all others may start processes. FastMCP itself is never imported here: the scripts below ``scripts/`` run in the
serving environment's own interpreter, because only that interpreter holds what the server will really import.
"""
