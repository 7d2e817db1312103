"""Where the door listens: the chosen interface, the first free port, the port of the last run."""

import contextlib
import random
import socket
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from web_doors import door

from octoform.server.transport.addresses import Listening, NoAddressError, addresses_of, listen


@contextmanager
def taken(*ports: int, address: str = "127.0.0.1") -> Iterator[None]:
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    held = []
    try:
        for port in ports:
            one = socket.socket(family)
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            one.bind((address, port))
            one.listen()
            held.append(one)
        yield
    finally:
        for one in held:
            one.close()


def free() -> int:
    """The first of some ports in a row that are free; below those that the system gives out itself."""
    while True:
        first = random.randrange(20000, 32000)
        with contextlib.suppress(OSError), taken(*range(first, first + 4)):
            return first


FIRST = free()


def network(**changes: Any) -> Mapping[str, Any]:
    return {"interface": "127.0.0.1", "port": FIRST, "hosts": [], "origins": [], **changes}


@contextmanager
def listening(run: Path, **changes: Any) -> Iterator[Listening]:
    found = listen(network(**changes), run, 16)
    try:
        yield found
    finally:
        found.close()


def test_first_free_port_is_taken_and_others_are_left_alone(tmp_path: Path) -> None:
    with taken(FIRST, FIRST + 1), listening(tmp_path) as found:
        assert found.port == FIRST + 2
        assert found.url == found.local_url == f"http://127.0.0.1:{FIRST + 2}"


def test_port_of_the_last_run_comes_first(tmp_path: Path) -> None:
    with taken(FIRST), listening(tmp_path) as found:
        assert found.port == FIRST + 1
    with listening(tmp_path) as found:
        assert found.port == FIRST + 1
    with taken(FIRST + 1), listening(tmp_path) as found:
        assert found.port == FIRST


def test_another_first_port_forgets_the_last_one(tmp_path: Path) -> None:
    with listening(tmp_path):
        pass
    with listening(tmp_path, port=FIRST + 3) as found:
        assert found.port == FIRST + 3


@pytest.mark.parametrize("text", ["{", "[]", '{"first": FIRST, "port": "x"}', '{"first": FIRST, "port": 22}'])
def test_damaged_record_of_the_last_run_counts_for_nothing(tmp_path: Path, text: str) -> None:
    (tmp_path / "network.json").write_text(text.replace("FIRST", str(FIRST)))
    with listening(tmp_path) as found:
        assert found.port == FIRST


def test_folder_in_the_place_of_the_record_is_moved_to_another_name(tmp_path: Path) -> None:
    (tmp_path / "network.json").mkdir()
    (tmp_path / "network.json" / "mine").touch()
    with listening(tmp_path) as found:
        assert f'"port": {found.port}' in (tmp_path / "network.json").read_text()
    assert len(list(tmp_path.glob("network.json.aside-*/mine"))) == 1


def test_no_free_port_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("octoform.server.transport.addresses.PORTS", 2)
    with taken(FIRST, FIRST + 1), pytest.raises(NoAddressError, match=f"no port from {FIRST} to {FIRST + 1} is free"):
        listen(network(), tmp_path, 16)


def test_ports_end_at_the_last(tmp_path: Path) -> None:
    with (
        contextlib.suppress(OSError),
        taken(65535),
        pytest.raises(NoAddressError, match="no port from 65535 to 65535 is free"),
    ):
        listen(network(port=65535), tmp_path, 16)


def test_interface_by_its_name() -> None:
    assert "127.0.0.1" in addresses_of("lo")
    assert "::1" in addresses_of("lo") or not socket.has_ipv6
    with pytest.raises(NoAddressError, match=r"'nope0' has no address; this machine has .*lo"):
        addresses_of("nope0")


def test_address_that_is_not_of_this_machine_is_told(tmp_path: Path) -> None:
    with pytest.raises(NoAddressError, match=r"cannot listen on 203\.0\.113\.7"):
        listen(network(interface="203.0.113.7"), tmp_path, 16)


def test_loopback_is_not_reached_by_another_name(tmp_path: Path) -> None:
    with listening(tmp_path) as found:
        assert [one.getsockname()[0] for one in found.sockets] == ["127.0.0.1"]


def test_everything_listens_on_both_families(tmp_path: Path) -> None:
    with listening(tmp_path, interface="all") as found:
        assert {one.getsockname()[1] for one in found.sockets} == {found.port}
        assert found.local_url == f"http://127.0.0.1:{found.port}"
        for address in ("127.0.0.1", "::1"):
            if address == "127.0.0.1" or len(found.addresses) == 2:
                socket.create_connection((address, found.port), timeout=5).close()


def test_port_that_one_family_has_is_taken_for_both(tmp_path: Path) -> None:
    if len(addresses_of("all")) < 2:
        pytest.skip("this machine has no IPv6")
    with taken(FIRST, address="::1"), listening(tmp_path, interface="all") as found:
        assert found.port == FIRST + 1


def test_ipv6_address(tmp_path: Path) -> None:
    if len(addresses_of("all")) < 2:
        pytest.skip("this machine has no IPv6")
    for written in ("::1", "[::1]"):
        with listening(tmp_path, interface=written) as found:
            assert found.url == f"http://[::1]:{found.port}"
            socket.create_connection(("::1", found.port), timeout=5).close()


def test_answers_do_not_wait_for_an_acknowledgement(tmp_path: Path) -> None:
    with door(tmp_path, {"port": FIRST}) as opened, opened.connect() as client:
        client.sendall(b"GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert client.recv(4096).startswith(b"HTTP/1.1 200")
        (connection,) = opened.web._uvicorn.server_state.connections
        accepted = connection.transport.get_extra_info("socket")
        assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def test_own_names_are_answered(tmp_path: Path) -> None:
    with door(tmp_path, {"interface": "lo", "port": FIRST}) as opened:
        name = socket.gethostname()
        for host in (
            "localhost",
            "127.0.0.1",
            f"127.0.0.1:{opened.port}",
            "[::1]",
            name,
            name.partition(".")[0] + ".local",
        ):
            assert opened.ask("GET", "/health", headers={"Host": host})[0] == 200, host
        assert opened.ask("GET", "/health", headers={"Host": "203.0.113.7"})[0] == 421
