"""From direct requirements to a lock: every distribution of the closure with its exact version and its hashes.

The lock is pip's requirements format in one normal form (sorted, no comments, no addresses), so that two hosts with
the same interpreter and the same answer of the index write the same bytes. A lock that stands already is kept as far
as it satisfies the requirements: a new release somewhere in the closure is no reason to change a working server.
"""

import os
import re
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from uv import find_uv_bin

from octoform.base.files import read, replace
from octoform.diagnostics import UNTRUSTED_CERTIFICATE, Diagnostic, error, is_untrusted_certificate
from octoform.endpoint.bounded_program import Finished, base_environment, run
from octoform.endpoint.environment.model import normal
from octoform.patterns import regex

# The package tool (uv): found, given a small environment, run for a bounded time, its reason made short.
#
# The user's own index configuration is kept: uv's variables as they are, and pip's index variables translated where
# uv has none, because a person behind a mirror has usually configured pip. Secrets in an index address reach the tool
# and never a diagnostic.

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
_CREDENTIALS = regex(r"(://)[^/@\s]+@")
_NETWORK = regex(
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


def network_hint(finished: Finished) -> str | None:
    """What to do when uv reports that it could not reach an index; None when it reports something else."""
    if is_untrusted_certificate(finished.stderr):
        return UNTRUSTED_CERTIFICATE
    return OFFLINE if finished.timed_out or _NETWORK.search(finished.stderr) is not None else None


def reason(finished: Finished) -> str:
    """uv's own reason, short: its first lines, without credentials."""
    if finished.timed_out:
        return f"no answer within {finished.seconds:.0f} s"
    lines = [line.strip() for line in finished.stderr.splitlines() if line.strip()]
    text = "\n".join(lines[:REASON_LINES]) or f"exit status {finished.status}"
    return _CREDENTIALS.sub(r"\1***@", text)[:1200]


Locked = tuple[str | None, tuple[Diagnostic, ...]]

_NAME = r"[A-Za-z0-9](?:[A-Za-z0-9._-]*[A-Za-z0-9])?"
_CLAUSE = r"(?:===?|!=|~=|<=?|>=?)\s*[A-Za-z0-9.*+!_-]+"
_REQUIREMENT = regex(
    rf"^\s*{_NAME}(?:\s*\[\s*{_NAME}(?:\s*,\s*{_NAME})*\s*\])?\s*(?:{_CLAUSE}(?:\s*,\s*{_CLAUSE})*)?\s*(?:;[^@\r\n]*)?$"
)
_PINNED = regex(rf"^({_NAME})==(\S+?)\s*(;[^\\]*?)?\s*\\?$")
_HASH = regex(r"--hash=(\S+)")


OFFLINE = "connect the host, or fill the package cache on it once"


def resolve(requirements: Sequence[str], project: Path, previous: str | None = None, timeout: float = 120.0) -> Locked:
    """The lock for ``requirements`` (``name==version`` or ranges, no addresses), or errors.

    The package cache answers first (about 0.15 s of wall time when it is warm) and the index only when the cache
    cannot: a host without a network still applies. ``project`` is where uv looks for the user's own configuration;
    ``previous`` is a lock whose versions are preferred. ``timeout`` is in seconds and bounds the whole.
    """
    refused = [item for item in requirements if not _REQUIREMENT.match(item)]
    if refused:
        return None, tuple(_refuse(item) for item in refused)
    with tempfile.TemporaryDirectory(prefix="octoform-lock-") as name:
        lock = Path(name, "requirements.txt")
        arguments = [*_ARGUMENTS, "-o", str(lock)]
        text = "\n".join(sorted(requirements)) + "\n"
        try:
            for extra in (["--offline"], []):
                replace(lock, (previous or "").encode(), synced=False)
                finished = packages([*arguments, *extra, "-"], project, timeout, text)
                if finished.status == 0:
                    return normalise(read(lock).decode()), ()
        except FileNotFoundError as problem:
            return None, (tool_missing(problem),)
    hint = network_hint(finished)
    return None, (
        error(
            "ENDPOINT-RESOLVE-FAILED",
            "no set of packages satisfies the server's requirements",
            detail=reason(finished),
            hint=hint or "change the requirements in DEPLOY's artifact or in the header of server.py",
        ),
    )


_ARGUMENTS = (
    "pip",
    "compile",
    "--quiet",
    "--generate-hashes",
    "--no-header",
    "--no-annotate",
    "--no-emit-index-url",
    "--no-emit-find-links",
    "--python",
    sys.executable,
)


def normalise(text: str) -> str:
    """The lock's one form: a line for each distribution, sorted by name, its hashes below it, sorted."""
    entries: dict[str, tuple[str, list[str]]] = {}
    current: list[str] = []
    for line in text.splitlines():
        pinned = _PINNED.match(line)
        if pinned:
            name = normal(pinned[1])
            current = []
            entries[name] = (f"{name}=={pinned[2]}" + (f" {pinned[3].strip()}" if pinned[3] else ""), current)
        else:
            current.extend(_HASH.findall(line))
    blocks = []
    for name in sorted(entries):
        head, hashes = entries[name]
        blocks.append(" \\\n".join([head, *(f"    --hash={item}" for item in sorted(set(hashes)))]))
    return "\n".join(blocks) + "\n" if blocks else ""


def tool_missing(problem: OSError) -> Diagnostic:
    """The error for a package tool that is not installed."""
    return error(
        "ENDPOINT-UV-MISSING",
        "the package tool uv is not installed beside octoform",
        detail=str(problem).splitlines()[0] if str(problem) else None,
        hint="install octoform with its dependencies again",
    )


def _refuse(requirement: str) -> Diagnostic:
    return error(
        "ENDPOINT-REQUIREMENT-REFUSED",
        f"{requirement[:120]!r} is not a plain requirement",
        hint="write a name and a version; addresses, paths and options would leave the allowed index",
    )
