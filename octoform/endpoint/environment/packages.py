"""The package tool (uv): found, given a small environment, run for a bounded time, its reason made short.

The user's own index configuration is kept: uv's variables as they are, and pip's index variables translated where
uv has none, because a person behind a mirror has usually configured pip. Secrets in an index address reach the tool
and never a diagnostic.
"""

import os
import re
from collections.abc import Sequence
from pathlib import Path

from uv import find_uv_bin

from octoform.endpoint.bounded_program import Finished, base_environment, run

_PREFIXES = ("UV_", "PIP_", "SSL_CERT_", "XDG_")
_NAMES = ("HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY", "NO_PROXY", "http_proxy", "https_proxy", "all_proxy", "no_proxy")
_FROM_PIP = (
    ("PIP_INDEX_URL", "UV_DEFAULT_INDEX", ("UV_INDEX_URL",)),
    ("PIP_EXTRA_INDEX_URL", "UV_INDEX", ("UV_EXTRA_INDEX_URL",)),
    ("PIP_FIND_LINKS", "UV_FIND_LINKS", ()),
)
_SYSTEM_CERTS = ("UV_SYSTEM_CERTS", "UV_NATIVE_TLS")
"""The system's certificates, which a host behind an inspecting proxy has been given: uv's name today, and before."""
_DROPPED = ("UV_PROJECT_ENVIRONMENT", "UV_SYSTEM_PYTHON", "UV_PYTHON", "UV_BREAK_SYSTEM_PACKAGES")
_CREDENTIALS = re.compile(r"(://)[^/@\s]+@")
_NETWORK = re.compile(
    r"error sending request|failed to fetch|dns error|connect(ion)? (error|refused|reset|timed out)|timed? ?out"
    r"|network is unreachable|network was disabled|failed to lookup address",
    re.IGNORECASE,
)
REASON_LINES = 4


def packages(arguments: Sequence[str], cwd: Path, timeout: float, stdin: str = "") -> Finished:
    """Run uv with these arguments; FileNotFoundError when the tool is not installed."""
    return run(
        [find_uv_bin(), *arguments],
        cwd=cwd,
        environment=tool_environment(),
        timeout=timeout,
        stdin=stdin,
    )


def tool_environment() -> dict[str, str]:
    """The variables that uv sees: the base ones, proxies, certificates, caches and the index configuration."""
    found = base_environment()
    for name, value in os.environ.items():
        if (name.startswith(_PREFIXES) or name in _NAMES) and name not in _DROPPED:
            found[name] = value
    for name in _SYSTEM_CERTS:
        found.setdefault(name, "true")
    for pip_name, uv_name, rivals in _FROM_PIP:
        if pip_name in found and uv_name not in found and not any(rival in found for rival in rivals):
            # pip separates by blanks; uv's find-links list wants commas.
            words = found[pip_name].split()
            found[uv_name] = ",".join(words) if uv_name == "UV_FIND_LINKS" else " ".join(words)
    return found


def is_network_failure(finished: Finished) -> bool:
    """True when uv says that it could not reach an index."""
    return finished.timed_out or _NETWORK.search(finished.stderr) is not None


def reason(finished: Finished) -> str:
    """uv's own reason, short: its first lines, without credentials."""
    if finished.timed_out:
        return f"no answer within {finished.seconds:.0f} s"
    lines = [line.strip() for line in finished.stderr.splitlines() if line.strip()]
    text = "\n".join(lines[:REASON_LINES]) or f"exit status {finished.status}"
    return _CREDENTIALS.sub(r"\1***@", text)[:1200]
