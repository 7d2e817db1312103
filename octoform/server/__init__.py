"""The process that owns a host's devices: it serves the generated server, unchanged, behind a gate.

Copied beside the connection descriptor and run in the serving environment, so of octoform it imports the base and the
policy alone, which are copied with it: else only the standard library and what FastMCP brings.
"""
