"""The known clients: where each keeps the servers of a user, how it writes one down, and how it refers to a token.

Tried with the real programs: Claude Code, Codex, Gemini CLI, opencode. The others as their documentation has them. A
token's value is never part of a form: where the client expands variables it is named, VS Code asks for it, and where
a client can do neither (``reference`` is None) the caller has to give the value. The file is always the user's own,
never a project's: the command holds absolute paths of this machine.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from octoform.endpoint.mcp_clients.text_edit import Path as KeyPath
from octoform.records import dataclass, field, replace

VARIABLE = "OCTOFORM_TOKEN"
"""Begins the variable that holds a token's value in the surroundings of a client; the host follows, see `of`."""
PREFIX = "octoform-"
"""Begins the name of a server; the host follows."""
STARTUP_SECONDS = 60
"""A small board needs ten times the second or two that a server's start takes elsewhere."""
GOOSE_SECONDS = 300
Form: TypeAlias = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Surroundings:
    """The inputs that decide the paths of files: the environment, and the system (``sys.platform``)."""

    environ: Mapping[str, str]
    platform: str = "linux"

    def home(self, *variables: str) -> Path:
        """The folder of the first variable that is set, else the user's home."""
        for name in (*variables, "USERPROFILE" if self.platform == "win32" else "HOME"):
            if self.environ.get(name):
                return Path(self.environ[name])
        return Path.home()

    def named(self, variable: str, default: Path) -> Path:
        """The folder or file that a variable names, or the default."""
        value = self.environ.get(variable)
        return Path(value).expanduser() if value else default

    def settings(self) -> Path:
        """Where programs with a window of their own keep settings."""
        if self.platform == "darwin":
            return self.home() / "Library" / "Application Support"
        if self.platform == "win32":
            return self.named("APPDATA", self.home() / "AppData" / "Roaming")
        return self.config()

    def config(self) -> Path:
        """Where programs of a terminal keep settings."""
        return self.named("XDG_CONFIG_HOME", self.home() / ".config")


Places: TypeAlias = Callable[[Surroundings], tuple[Path, ...]]
"""The files in which a client would look, the preferred one first; it is taken when none is there."""


def _claude_code_files(around: Surroundings) -> tuple[Path, ...]:
    """One file for everything that the program remembers."""
    return (around.named("CLAUDE_CONFIG_DIR", around.home()) / ".claude.json",)


def _claude_desktop_files(around: Surroundings) -> tuple[Path, ...]:
    """In the settings of the window program."""
    return (around.settings() / "Claude" / "claude_desktop_config.json",)


def _codex_files(around: Surroundings) -> tuple[Path, ...]:
    """In its home."""
    return (around.named("CODEX_HOME", around.home() / ".codex") / "config.toml",)


def _gemini_cli_files(around: Surroundings) -> tuple[Path, ...]:
    """In the user's settings; ``GEMINI_CLI_HOME`` stands for the home folder."""
    return (around.home("GEMINI_CLI_HOME") / ".gemini" / "settings.json",)


def _cursor_files(around: Surroundings) -> tuple[Path, ...]:
    """In the home folder on every system."""
    return (around.home() / ".cursor" / "mcp.json",)


def _vscode_files(around: Surroundings) -> tuple[Path, ...]:
    """In the default profile; a portable installation has it beside the program."""
    portable = around.environ.get("VSCODE_PORTABLE")
    base = Path(portable) / "user-data" if portable else around.settings() / "Code"
    return (base / "User" / "mcp.json",)


def _opencode_files(around: Surroundings) -> tuple[Path, ...]:
    """It reads all of them, and makes the first by itself."""
    folder = around.config() / "opencode"
    return tuple(folder / name for name in ("opencode.jsonc", "opencode.json", "config.json"))


def _goose_files(around: Surroundings) -> tuple[Path, ...]:
    """The same folder on Linux and macOS."""
    if around.environ.get("GOOSE_PATH_ROOT"):
        return (Path(around.environ["GOOSE_PATH_ROOT"]) / "config" / "config.yaml",)
    if around.platform == "win32":
        return (around.settings() / "Block" / "goose" / "config" / "config.yaml",)
    return (around.config() / "goose" / "config.yaml",)


def _lm_studio_files(around: Surroundings) -> tuple[Path, ...]:
    """Some builds keep it with their cache."""
    return (around.home() / ".lmstudio" / "mcp.json", around.home() / ".cache" / "lm-studio" / "mcp.json")


def _openclaw_files(around: Surroundings) -> tuple[Path, ...]:
    """In its state folder, unless its configuration is named by itself."""
    folder = around.named("OPENCLAW_STATE_DIR", around.home("OPENCLAW_HOME") / ".openclaw")
    return (around.named("OPENCLAW_CONFIG_PATH", folder / "openclaw.json"),)


@dataclass(frozen=True, slots=True)
class Client:
    """One client. ``key`` is its name on the command line, ``file`` that of its ready-made configuration.

    ``table`` leads to its servers in the file. ``stdio(command)`` and ``http(url, bearer)`` are its forms of a
    server, ``http`` None where it has none. ``bearer`` is what stands for the token: ``reference``, or a value.
    ``variable`` is what holds it. ``prompt`` is an element of a list of the file that belongs to the HTTP form.
    ``after`` states what a person has to do until the client sees a change.
    """

    key: str
    title: str
    file: str
    notation: str
    places: Places
    table: KeyPath
    stdio: Callable[[Sequence[str]], Form]
    http: Callable[[str, str], Form] | None
    reference: str | None
    after: str
    aliases: tuple[str, ...] = ()
    older: KeyPath | None = None
    prompt: tuple[KeyPath, Form] | None = None
    named: bool = field(default=False)
    variable: str = VARIABLE


def of(client: Client, name: str) -> Client:
    """The client as it refers to the token of the server ``name``; each host has its own variable.

    One client may have several hosts, and their tokens differ. `CLIENTS` has what is the same for all servers.
    """
    host = name.removeprefix(PREFIX)
    variable = f"{VARIABLE}_{re.sub('[^A-Z0-9]', '_', host.upper())}"
    reference, prompt = client.reference, client.prompt
    if reference is not None:
        reference = reference.replace(VARIABLE, variable).replace(INPUT, f"{INPUT}-{host}")
    if prompt is not None:
        prompt = (prompt[0], {**prompt[1], "id": f"{INPUT}-{host}", "description": f"Token of octoform's {host}"})
    return replace(client, reference=reference, prompt=prompt, variable=variable)


def form(client: Client, name: str, command: Sequence[str], url: str | None, bearer: str | None = None) -> Form | None:
    """The client's entry: HTTP when there is a URL, else stdio; None when it knows no HTTP."""
    if url is None:
        entry = client.stdio(command)
    elif client.http is None:
        return None
    else:
        entry = client.http(url, bearer or client.reference or f"${{{client.variable}}}")
    return {"name": name, **entry} if client.named else entry


def words(entry: Mapping[str, Any]) -> tuple[str, ...]:
    """The command of an entry in any client's form, () for none."""
    first = entry.get("command", entry.get("cmd"))
    start = first if isinstance(first, list) else [first]
    rest = entry.get("args")
    found = [*start, *(rest if isinstance(rest, list) else [])]
    return tuple(found) if all(isinstance(word, str) for word in found) else ()


def address(entry: Mapping[str, Any]) -> str | None:
    """The URL of an entry in any client's form."""
    found = next((entry[key] for key in ("url", "uri", "httpUrl") if key in entry), None)
    return found if isinstance(found, str) else None


def table_of(client: Client, content: Mapping[str, Any]) -> KeyPath:
    """Where a new server goes: the older notation where the file has it and not the newer one."""
    if client.older is None:
        return client.table
    inner = content.get(client.older[-1])
    if not isinstance(inner, dict):
        return client.table
    servers = {key for key, value in inner.items() if isinstance(value, dict) and _SERVER & value.keys()}
    nested = inner.get(client.table[-1])
    return client.older if servers and (client.table[-1] in servers or not isinstance(nested, dict)) else client.table


def _split(command: Sequence[str]) -> tuple[str, list[str]]:
    return (command[0] if command else "", list(command[1:]))


def _plain(command: Sequence[str]) -> Form:
    first, rest = _split(command)
    return {"command": first, "args": rest}


def _typed(command: Sequence[str]) -> Form:
    return {"type": "stdio", **_plain(command)}


def _codex(command: Sequence[str]) -> Form:
    return {**_plain(command), "startup_timeout_sec": STARTUP_SECONDS}


def _opencode(command: Sequence[str]) -> Form:
    return {"type": "local", "command": list(command)}


def _goose(command: Sequence[str]) -> Form:
    first, rest = _split(command)
    form: Form = {"type": "stdio", "cmd": first, "args": rest, "envs": {}}
    return {**form, "enabled": True, "timeout": GOOSE_SECONDS}


def _bearer(text: str) -> Form:
    return {"headers": {"Authorization": f"Bearer {text}"}}


def _typed_http(url: str, bearer: str) -> Form:
    return {"type": "http", "url": url, **_bearer(bearer)}


def _plain_http(url: str, bearer: str) -> Form:
    return {"url": url, **_bearer(bearer)}


def _codex_http(url: str, bearer: str) -> Form:
    return {"url": url, "bearer_token_env_var": bearer}


def _opencode_http(url: str, bearer: str) -> Form:
    return {"type": "remote", "url": url, **_bearer(bearer)}


def _goose_http(url: str, bearer: str) -> Form:
    keys = re.findall(rf"{VARIABLE}\w*", bearer)
    form: Form = {"type": "streamable_http", "uri": url, **_bearer(bearer), "env_keys": keys}
    return {**form, "enabled": True, "timeout": GOOSE_SECONDS}


def _openclaw_http(url: str, bearer: str) -> Form:
    return {"url": url, "transport": "streamable-http", **_bearer(bearer)}


_SERVER = {"type", "command", "url", "enabled"}
_SHELL = f"${{{VARIABLE}}}"
INPUT = "octoform-token"
_PROMPT: Form = {"type": "promptString", "id": INPUT, "description": "Token of the octoform endpoint", "password": True}
_SERVERS = ("mcpServers",)

CLIENTS: Mapping[str, Client] = {
    client.key: client
    for client in (
        Client(
            "claude-code", "Claude Code", "claude-code.json", "json", _claude_code_files, _SERVERS, _typed, _typed_http,
            _SHELL, "start a new session of claude", ("claude", "claudecode"),
        ),
        Client(
            "claude-desktop", "Claude Desktop", "claude-desktop.json", "json", _claude_desktop_files, _SERVERS, _plain,
            None, None, "quit Claude Desktop and start it again",
        ),
        Client(
            "codex", "Codex", "codex.toml", "toml", _codex_files, ("mcp_servers",), _codex, _codex_http,
            VARIABLE, "start a new session of codex", ("codex-cli", "openai-codex"),
        ),
        Client(
            "gemini-cli", "Gemini CLI", "gemini-cli.json", "json", _gemini_cli_files, _SERVERS, _plain, _typed_http,
            _SHELL, "start a new session of gemini", ("gemini",),
        ),
        Client(
            "cursor", "Cursor", "cursor.json", "json", _cursor_files, _SERVERS, _plain, _plain_http,
            f"${{env:{VARIABLE}}}", "enable the server in Cursor's settings, if it is not",
        ),
        Client(
            "vscode", "VS Code", "vscode.json", "json", _vscode_files, ("servers",), _typed, _typed_http,
            f"${{input:{INPUT}}}", "start the server from VS Code's list of MCP servers",
            ("vs-code", "visual-studio-code", "code", "copilot"), prompt=(("inputs",), _PROMPT),
        ),
        Client(
            "opencode", "opencode", "opencode.json", "json", _opencode_files, ("mcp", "servers"), _opencode,
            _opencode_http, f"{{env:{VARIABLE}}}", "start opencode again", ("open-code",), older=("mcp",),
        ),
        Client(
            "goose", "Goose", "goose.yaml", "yaml", _goose_files, ("extensions",), _goose, _goose_http,
            _SHELL, "start a new session of goose", ("block-goose",), named=True,
        ),
        Client(
            "lm-studio", "LM Studio", "lm-studio.json", "json", _lm_studio_files, _SERVERS, _plain, _plain_http,
            None, "LM Studio reads the file again by itself", ("lmstudio", "lms"),
        ),
        Client(
            "openclaw", "OpenClaw", "openclaw.json", "json", _openclaw_files, ("mcp", "servers"), _plain,
            _openclaw_http, _SHELL, "run openclaw mcp reload", ("open-claw", "clawdbot"),
        ),
    )
}  # fmt: skip
