"""Commands on the live endpoint: its process, tools, calls, clients, tokens and safety."""
