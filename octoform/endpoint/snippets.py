"""One ready-made configuration for each MCP client, in the client's own format.

Absolute paths and no environment: the launcher sets what the server needs, so a client can start it from anywhere.
Formats as the clients' documentation gives them (Claude Code, Codex and Gemini CLI tried with the real programs).
"""

import json
from collections.abc import Callable

STARTUP_SECONDS = 60
"""A small board needs ten times the second or two that a server's start takes elsewhere."""


def snippets(name: str, command: str) -> dict[str, str]:
    """File name to text for each client; ``name`` is what the client calls the server, ``command`` its launcher."""
    return {file: render(name, command) for file, render in _CLIENTS.items()}


def _claude_code(name: str, command: str) -> str:
    return _json({"mcpServers": {name: {"type": "stdio", "command": command, "args": []}}})


def _mcp_servers(name: str, command: str) -> str:
    return _json({"mcpServers": {name: {"command": command, "args": []}}})


def _vscode(name: str, command: str) -> str:
    return _json({"servers": {name: {"type": "stdio", "command": command, "args": []}}})


def _opencode(name: str, command: str) -> str:
    # The current major version nests servers; the one before has them directly below "mcp".
    return _json({"mcp": {"servers": {name: {"type": "local", "command": [command]}}}})


def _codex(name: str, command: str) -> str:
    lines = [f"[mcp_servers.{_quoted(name)}]", f"command = {_quoted(command)}", "args = []"]
    return "\n".join([*lines, f"startup_timeout_sec = {STARTUP_SECONDS}"]) + "\n"


def _goose(name: str, command: str) -> str:
    fields = {"name": name, "type": "stdio", "cmd": command, "args": [], "envs": {}, "enabled": True, "timeout": 300}
    lines = [f"    {key}: {json.dumps(value, ensure_ascii=False)}" for key, value in fields.items()]
    return "\n".join(["extensions:", f"  {_quoted(name)}:", *lines]) + "\n"


def _json(value: object) -> str:
    return json.dumps(value, indent=2, ensure_ascii=False) + "\n"


def _quoted(text: str) -> str:
    """A string that JSON, YAML and TOML read alike."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


_CLIENTS: dict[str, Callable[[str, str], str]] = {
    "claude-code.json": _claude_code,
    "claude-desktop.json": _mcp_servers,
    "codex.toml": _codex,
    "cursor.json": _mcp_servers,
    "gemini-cli.json": _mcp_servers,
    "goose.yaml": _goose,
    "lm-studio.json": _mcp_servers,
    "opencode.json": _opencode,
    "vscode.json": _vscode,
}
