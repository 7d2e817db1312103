"""The environment of an agent: what it needs to run and what its harness names, nothing else of the caller's.

A shell's environment is full of secrets that have nothing to do with the task, and an agent may print all of it. So
the set is built up from nothing instead of cleaned.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from octoform.base.files import remove_tree

FALLBACK_PATH = "/usr/local/bin:/usr/bin:/bin"
PREFIX = "OCTOFORM_"
SECRET_WORDS = ("TOKEN", "SECRET", "PASSWORD", "KEY", "CREDENTIAL")
TASK = "OCTOFORM_TASK"
PROMPT = "OCTOFORM_PROMPT"
OUTPUT = "OCTOFORM_OUTPUT"
ATTEMPT = "OCTOFORM_ATTEMPT"
PRIVATE = ("home", "tmp")
"""Folders of an attempt that are no part of its record: they may be large, or hold what a program cached of a login."""


CERTIFICATES = ("SSL_CERT_FILE", "SSL_CERT_DIR", "NODE_EXTRA_CA_CERTS", "REQUESTS_CA_BUNDLE")
STORES = (
    "/etc/ssl/certs/ca-certificates.crt",
    "/etc/pki/tls/certs/ca-bundle.crt",
    "/etc/ssl/ca-bundle.pem",
    "/etc/ssl/cert.pem",
)
"""Where systems keep the certificates that they trust as one file."""


def certificates(caller: Mapping[str, str], stores: Sequence[str] = STORES) -> dict[str, str]:
    """The variables that name the certificates to trust: the caller's, else the system's store.

    Node and most libraries of Python trust lists of their own, which know no company's proxy and no private server.
    """
    found = {name: caller[name] for name in CERTIFICATES if caller.get(name)}
    store = next((name for name in stores if Path(name).is_file()), None)
    if store is not None and not found.keys() & {"SSL_CERT_FILE", "SSL_CERT_DIR"}:
        found["SSL_CERT_FILE"] = store
    if "SSL_CERT_FILE" in found:
        found.setdefault("NODE_EXTRA_CA_CERTS", found["SSL_CERT_FILE"])
    return found


def minimal(workdir: Path, caller: Mapping[str, str], named: Sequence[str] = ()) -> dict[str, str]:
    """The environment of an agent in ``workdir``; makes its private ``home`` and ``tmp`` folders there (0700).

    ``caller`` is where PATH, OCTOFORM_* settings, certificates and the ``named`` variables come from; a named one that
    the caller lacks is omitted. An OCTOFORM_ variable whose name states that it is a secret is passed only when named.
    """
    out = certificates(caller)
    out |= {name: value for name, value in caller.items() if name.startswith(PREFIX) and not is_secret(name)}
    out |= {
        "PATH": caller.get("PATH") or FALLBACK_PATH,
        "HOME": str(_folder(workdir / PRIVATE[0])),
        "TMPDIR": str(_folder(workdir / PRIVATE[1])),
        "LANG": "C.UTF-8",
        "LC_ALL": "C.UTF-8",
        "TERM": "dumb",
    }
    out |= {name: caller[name] for name in named if name in caller}
    return out


def remove_private(workdir: Path) -> None:
    """Remove what `minimal` made, with all that the agent put there; what cannot be removed stays.

    A link in the place of the attempt's folder is not followed.
    """
    if workdir.is_symlink():
        return
    for name in PRIVATE:
        with suppress(OSError):
            remove_tree(workdir / name)


def is_secret(name: str) -> bool:
    """True for a variable whose name states that its value is a secret."""
    return any(word in name.upper() for word in SECRET_WORDS)


def secrets(caller: Mapping[str, str], named: Sequence[str]) -> dict[str, str]:
    """The named variables' values that must not reach a log, by name."""
    return {name: caller[name] for name in named if caller.get(name)}


def _folder(path: Path) -> Path:
    path.mkdir(mode=0o700, exist_ok=True)
    return path
