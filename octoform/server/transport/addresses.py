"""Where the endpoint listens: addresses of an interface, and a port that no one else has. Standard library only.

A port that is taken stays with anyone who has it. The port of the last run comes first, because clients have it in
their configuration.
"""

import contextlib
import errno
import fcntl
import ipaddress
import json
import socket
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from octoform.base.files import make_way, read_json, replace
from octoform.base.place import KEY, is_from, place_of

ALL = "all"
PORTS = 100
"""How many ports are tried, from the first one on."""
RECORD = "network.json"
_SIOCGIFADDR = 0x8915
_IPV6_ADDRESSES = Path("/proc/net/if_inet6")
_LINK_LOCAL = 0x20


class NoAddressError(Exception):
    """The endpoint cannot listen where it should; the text is one line for a person."""


@dataclass(frozen=True, slots=True)
class Listening:
    """Sockets that listen already. ``url`` is for other machines where there is one, ``local_url`` for this one."""

    sockets: tuple[socket.socket, ...]
    port: int
    addresses: tuple[str, ...]
    url: str
    local_url: str

    def close(self) -> None:
        """Give the port back."""
        for one in self.sockets:
            one.close()


def listen(network: Mapping[str, Any], run: Path, backlog: int) -> Listening:
    """Listen on the chosen interface; NoAddressError when it has no address or no port is free."""
    interface, first = str(network["interface"]), int(network["port"])
    addresses = addresses_of(interface)
    for port in _candidates(run, first):
        sockets = _bound(addresses, port, backlog)
        if sockets is not None:
            return _listening(sockets, interface, addresses, port, run, first)
    raise NoAddressError(f"no port from {first} to {min(first + PORTS, 65536) - 1} is free on {', '.join(addresses)}")


def addresses_of(interface: str) -> tuple[str, ...]:
    """The addresses to bind for ``all``, an address, or an interface (eth0); NoAddressError when there is none."""
    if interface == ALL:
        return ("0.0.0.0", "::") if _has_ipv6() else ("0.0.0.0",)
    with contextlib.suppress(ValueError):
        return (str(ipaddress.ip_address(interface.strip("[]"))),)
    found = (*_ipv4_of(interface), *_ipv6_of(interface))
    if not found:
        known = ", ".join(name for _, name in socket.if_nameindex())
        raise NoAddressError(f"network.interface: {interface!r} has no address; this machine has {known}")
    return found


def _candidates(run: Path, first: int) -> Sequence[int]:
    ports = [port for port in range(first, first + PORTS) if port < 65536]
    try:
        record = read_json(run / RECORD, follow=False)
        # The port of the folder that this one was copied from stays with that one, also while it is stopped.
        last = record["port"] if record["first"] == first and is_from(record, run) else None
    except (OSError, ValueError, LookupError, TypeError):
        last = None
    return ports if last not in ports else [last, *(port for port in ports if port != last)]


def _bound(addresses: Sequence[str], port: int, backlog: int) -> tuple[socket.socket, ...] | None:
    """Sockets that listen at ``port`` of every address; None when somebody has one of them."""
    made: list[socket.socket] = []
    try:
        for address in addresses:
            made.append(_socket(address, port, backlog))
    except OSError as problem:
        for one in made:
            one.close()
        if problem.errno in (errno.EADDRINUSE, errno.EACCES):
            return None
        raise NoAddressError(f"cannot listen on {address} port {port}: {problem.strerror}") from problem
    return tuple(made)


def _socket(address: str, port: int, backlog: int) -> socket.socket:
    version = ipaddress.ip_address(address).version
    # The protocol is named: only then does asyncio send each piece of an answer at once (TCP_NODELAY), and with none
    # every answer would wait 40 ms for the client's acknowledgement.
    family = socket.AF_INET6 if version == 6 else socket.AF_INET
    made = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        # Only lets the port be taken again while old connections fade; it never takes a port from a listener.
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if version == 6:
            made.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        made.bind((address, port))
        made.listen(backlog)
    except OSError:
        made.close()
        raise
    return made


def _listening(
    sockets: tuple[socket.socket, ...], interface: str, addresses: Sequence[str], port: int, run: Path, first: int
) -> Listening:
    everywhere = interface == ALL
    url = _url(_outward() if everywhere else addresses[0], port)
    local_url = _url("127.0.0.1" if everywhere else addresses[0], port)
    record = {"format": 1, "first": first, "port": port, "addresses": list(addresses), "url": url, KEY: place_of(run)}
    make_way(run / RECORD)
    replace(run / RECORD, json.dumps(record, indent=1).encode())
    return Listening(sockets, port, tuple(addresses), url, local_url)


def _url(address: str, port: int) -> str:
    return f"http://[{address}]:{port}" if ":" in address else f"http://{address}:{port}"


def _outward() -> str:
    """The address that this machine would use towards others; nothing is sent for it."""
    for family, target in ((socket.AF_INET, "192.0.2.1"), (socket.AF_INET6, "2001:db8::1")):
        with contextlib.suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect((target, 9))
            return str(probe.getsockname()[0])
    return "127.0.0.1"


def _has_ipv6() -> bool:
    try:
        with socket.socket(socket.AF_INET6, socket.SOCK_STREAM) as probe:
            probe.bind(("::1", 0))
    except OSError:
        return False
    return True


def _ipv4_of(interface: str) -> tuple[str, ...]:
    """The IPv4 address of an interface (netdevice(7))."""
    request = struct.pack("256s", interface.encode()[:15])
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            answer = fcntl.ioctl(probe, _SIOCGIFADDR, request)
    except OSError:
        return ()
    return (socket.inet_ntoa(answer[20:24]),)


def _ipv6_of(interface: str) -> tuple[str, ...]:
    """Its IPv6 addresses but the link-local ones, which mean nothing without a zone."""
    try:
        rows = [line.split() for line in _IPV6_ADDRESSES.read_text().splitlines()]
    except OSError:
        return ()
    ours = [row[0] for row in rows if row[5] == interface and int(row[3], 16) != _LINK_LOCAL]
    return tuple(str(ipaddress.IPv6Address(bytes.fromhex(text))) for text in ours)
