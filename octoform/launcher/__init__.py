"""The process that owns a host's devices: it serves the generated server, unchanged, behind a gate.

Copied beside the connection descriptor and run in the serving environment, so it imports nothing of octoform: only the
standard library and what FastMCP brings.
"""
