"""Where each client keeps the servers of a user, on every system, with the variables that move it.

Always the user's own file, never a project's: the command holds absolute paths of this machine.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeAlias

from octoform.records import dataclass


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


def claude_code(around: Surroundings) -> tuple[Path, ...]:
    """One file for everything that the program remembers."""
    return (around.named("CLAUDE_CONFIG_DIR", around.home()) / ".claude.json",)


def claude_desktop(around: Surroundings) -> tuple[Path, ...]:
    """In the settings of the window program."""
    return (around.settings() / "Claude" / "claude_desktop_config.json",)


def codex(around: Surroundings) -> tuple[Path, ...]:
    """In its home."""
    return (around.named("CODEX_HOME", around.home() / ".codex") / "config.toml",)


def gemini_cli(around: Surroundings) -> tuple[Path, ...]:
    """In the user's settings; ``GEMINI_CLI_HOME`` stands for the home folder."""
    return (around.home("GEMINI_CLI_HOME") / ".gemini" / "settings.json",)


def cursor(around: Surroundings) -> tuple[Path, ...]:
    """In the home folder on every system."""
    return (around.home() / ".cursor" / "mcp.json",)


def vscode(around: Surroundings) -> tuple[Path, ...]:
    """In the default profile; a portable installation has it beside the program."""
    portable = around.environ.get("VSCODE_PORTABLE")
    base = Path(portable) / "user-data" if portable else around.settings() / "Code"
    return (base / "User" / "mcp.json",)


def opencode(around: Surroundings) -> tuple[Path, ...]:
    """It reads all of them, and makes the first by itself."""
    folder = around.config() / "opencode"
    return tuple(folder / name for name in ("opencode.jsonc", "opencode.json", "config.json"))


def goose(around: Surroundings) -> tuple[Path, ...]:
    """The same folder on Linux and macOS."""
    if around.environ.get("GOOSE_PATH_ROOT"):
        return (Path(around.environ["GOOSE_PATH_ROOT"]) / "config" / "config.yaml",)
    if around.platform == "win32":
        return (around.settings() / "Block" / "goose" / "config" / "config.yaml",)
    return (around.config() / "goose" / "config.yaml",)


def lm_studio(around: Surroundings) -> tuple[Path, ...]:
    """Some builds keep it with their cache."""
    return (around.home() / ".lmstudio" / "mcp.json", around.home() / ".cache" / "lm-studio" / "mcp.json")


def openclaw(around: Surroundings) -> tuple[Path, ...]:
    """In its state folder, unless its configuration is named by itself."""
    folder = around.named("OPENCLAW_STATE_DIR", around.home("OPENCLAW_HOME") / ".openclaw")
    return (around.named("OPENCLAW_CONFIG_PATH", folder / "openclaw.json"),)
