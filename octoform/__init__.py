"""octoform: the hardware of a host under the control of AI agents, as code.

A compiler with a slow, untrusted back end: a manifest and prose specs go in, an agent runs five stages, each
stage's output counts only once its contract accepts it, and a live typed MCP endpoint comes out.
"""

__version__ = "0.2.0"
