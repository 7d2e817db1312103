"""Import what every server and every client imports, so that its bytecode is there when they start."""

import anyio
import jsonschema
import mcp.server.stdio
from fastmcp import Client, FastMCP

LOADED = (anyio, jsonschema, mcp.server.stdio, Client, FastMCP)
