"""Outputs of an agent that wants to be done: placeholders, copied values, other units, plausible facts.

Each set was written before anybody looked at what the rules say of it, and then stayed.
"""

import novel_servers

SERVE_WRONG, SERVE_RIGHT = novel_servers.WRONG, novel_servers.RIGHT
