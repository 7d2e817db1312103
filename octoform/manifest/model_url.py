"""The URL of a model's API as a manifest gives it: what is one, and which are on this machine. Light.

References to variables may be in it, so it is looked at twice: as it is written, and with its values. What is stated
about it never repeats it: a URL may hold what its author did not want to be seen.
"""

import ipaddress
import re
from urllib.parse import urlsplit

from octoform.manifest.references import contains
from octoform.patterns import regex

URL_PATTERN = r"^(https?://[^\s/?#@]+(/[^\s?#@]*)?|\$\{[A-Za-z_][A-Za-z0-9_]*\}[^\s?#@]*)$"
URL_HINT = "write where the API is, such as http://127.0.0.1:8080 or https://models.example.org/v1"
_REFERENCE = regex(r"\$\{[^{}]*\}?")
_LOCAL_NAMES = ("localhost", "localhost.localdomain")


def url_complaint(url: str) -> tuple[str, str] | None:
    """The reason why a URL without references is no base URL, and what to do; None when it is one."""
    try:
        parts = urlsplit(url)
        port, host = parts.port, parts.hostname
    except ValueError:
        return "this is no URL", URL_HINT
    if parts.scheme not in ("http", "https") or not host or port == 0 or re.search(r"\s", url):
        return "this is no URL of http or https", URL_HINT
    if "@" in url:
        return "a base URL holds no user and no password", "name the variable of the key in `key`"
    if "?" in url or "#" in url:
        return "a base URL ends with its path", "remove what begins with ? or #; name the variable of the key in `key`"
    return None


def url_complaint_as_written(text: str) -> tuple[str, str] | None:
    """As `complaint`, of a string that may hold references; what they stand for is not known here."""
    if not contains(text):
        return url_complaint(text)
    # A digit may be in a host, a port and a path; what begins with a reference may begin with any scheme.
    filled = _REFERENCE.sub("1", text)
    return url_complaint(f"http://{filled}" if text.startswith("${") else filled)


def is_loopback(url: str) -> bool:
    """True for a URL, without references, of a server on this machine."""
    try:
        host = urlsplit(url).hostname or ""
    except ValueError:
        return False
    if host in _LOCAL_NAMES or host.endswith(".localhost"):
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


# Names of hosts: what is legal, and what comes nearest to a name that is not. Light, for `init` and `validate`.

HOST_PATTERN = r"^[a-z0-9]([a-z0-9-]{0,61}[a-z0-9])?$"
DEFAULT_HOST = "local"


def is_legal_host(name: str) -> bool:
    """True for a DNS label in lower case, which is also safe as the name of a folder on every file system."""
    return re.fullmatch(HOST_PATTERN[1:-1], name) is not None


def nearest_host(text: str) -> str:
    """The nearest legal name to a string, empty when nothing is left of it."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")[:63].strip("-")


def host_of_machine(machine: str) -> str:
    """A name for a machine: the first label of its own name, or the default where that states nothing."""
    name = nearest_host(machine.split(".")[0])
    return DEFAULT_HOST if name in ("", "localhost") else name
