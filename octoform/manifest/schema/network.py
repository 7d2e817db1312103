"""How clients elsewhere reach the endpoint, as a manifest writes it. (Heavy: pydantic.)"""

import re
from ipaddress import ip_address
from typing import Annotated

from pydantic import AfterValidator, Field

from octoform.manifest.model import EVERY_INTERFACE, FIRST_PORT, TUNNEL_COMMAND, TUNNEL_URL
from octoform.manifest.schema.fields import UNIQUE, Argument, Table, distinct, problem

_ADDRESS = r"[0-9A-Fa-f:.]*:[0-9A-Fa-f:.]*"
INTERFACE_PATTERN = rf"^([A-Za-z0-9_][A-Za-z0-9_.-]{{0,14}}|{_ADDRESS})$"
_LABEL = r"[A-Za-z0-9]([A-Za-z0-9-]{0,61}[A-Za-z0-9])?"
_NAME = rf"{_LABEL}(\.{_LABEL})*"
HOST_PATTERN = rf"^({_NAME}|{_ADDRESS})$"
ORIGIN_PATTERN = rf"^https?://({_NAME}|\[[0-9A-Fa-f:.]+\])(:[0-9]{{1,5}})?$"
_LONGEST_HOST = 253
_PLACEHOLDER = re.compile(r"(?<![{$])\{([A-Za-z_][A-Za-z0-9_]*)\}(?!\})")


def _interface(value: str) -> str:
    hint = "name one, such as eth0 (`ip -brief address` lists them), or write `all`"
    if _is_address(value):
        address = ip_address(value)
        if address.is_unspecified:
            raise problem("this address stands for every interface", "write `all`")
        if address.is_multicast:
            raise problem("this is no address of one host", hint)
    elif ":" in value or re.fullmatch(INTERFACE_PATTERN[1:-1], value) is None:
        raise problem("this is no network interface", hint)
    return value


def _host(value: str) -> str:
    if "://" in value or "/" in value:
        raise problem("this is a URL, and a host name is needed", "write the name alone, such as bench.example.org")
    if "*" in value:
        raise problem("a host is named in full", "list each name that clients use")
    if _is_address(value):
        return value
    if ":" in value:
        raise problem("a host stands here without a port", "write the name alone, such as bench.example.org")
    if not re.fullmatch(_NAME, value) or len(value) > _LONGEST_HOST:
        raise problem("this is no host name", "write it as clients do, such as bench.example.org")
    return value


def _is_address(value: str) -> bool:
    try:
        ip_address(value)
    except ValueError:
        return False
    return True


def _origin(value: str) -> str:
    found = re.fullmatch(ORIGIN_PATTERN[1:-1], value)
    if found is None or not _is_port(found.groups()[-1]) or not _is_bracketed(value):
        hint = (
            "write it as a browser sends it: https://app.example.org, with a port if it is not the usual one, no path"
        )
        raise problem("this is no origin", hint)
    return value


def _is_port(text: str | None) -> bool:
    return text is None or 1 <= int(text[1:]) <= 65535


def _is_bracketed(value: str) -> bool:
    """True unless brackets hold what is no address."""
    found = re.search(r"\[(.*)\]", value)
    return found is None or _is_address(found.group(1))


def _command(values: list[str]) -> list[str]:
    if not values[0].strip():
        raise problem("the first item of a command is a program", "name the program", 0)
    for index, value in enumerate(values):
        other = next((name for name in _PLACEHOLDER.findall(value) if name != "url"), None)
        if other is not None:
            raise problem(f"{{{other[:40]}}} is no placeholder", f"the only one is {TUNNEL_URL}", index)
    if not any(TUNNEL_URL in value for value in values):
        raise problem(
            f"nothing tells the program where the endpoint is: {TUNNEL_URL} is missing",
            f'write for example [cloudflared, tunnel, --url, "{TUNNEL_URL}"]',
        )
    return values


Host = Annotated[str, AfterValidator(_host), Field(json_schema_extra={"pattern": HOST_PATTERN})]
Origin = Annotated[str, AfterValidator(_origin), Field(max_length=300, json_schema_extra={"pattern": ORIGIN_PATTERN})]


class Network(Table):
    """Where the endpoint listens, and who it answers to; for the scopes intranet and internet."""

    interface: Annotated[str, AfterValidator(_interface), Field(json_schema_extra={"pattern": INTERFACE_PATTERN})] = (
        EVERY_INTERFACE
    )
    """The network interface that it listens on, such as eth0, or one address of it; `all` for every one."""
    port: Annotated[int, Field(ge=1, le=65535)] = FIRST_PORT
    """The port; the next free one where it is taken."""
    hosts: Annotated[list[Host], AfterValidator(distinct), Field(max_length=100, json_schema_extra=UNIQUE)] = Field(
        default=[]
    )
    """More names that clients may call this host by, beside its own name and addresses."""
    origins: Annotated[list[Origin], AfterValidator(distinct), Field(max_length=100, json_schema_extra=UNIQUE)] = Field(
        default=[]
    )
    """Web pages that may call the endpoint from a browser."""


class Tunnel(Table):
    """The program that gives the endpoint an address on the internet; for the scope internet."""

    command: Annotated[list[Argument], Field(min_length=1, max_length=200), AfterValidator(_command)] = Field(
        default=list(TUNNEL_COMMAND)
    )
    """The program and its arguments; {url} stands for the endpoint's own address. It prints the address it gives."""
