"""The live endpoint: tools, calls, clients, tokens, safety, its process and its logs."""
