"""MCP clients: where each keeps its servers, in which notation, and how an entry comes in and goes out again."""
