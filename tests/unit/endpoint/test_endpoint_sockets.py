"""A client that was never greeted was never taken: a dying process is distinguished from a slow one."""

import os
import select
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from octoform.endpoint.sockets import GREETING, greeted
from octoform.endpoint.stdio import pipe
from octoform.server.process.local_socket import listen
from octoform.server.transport import unix_socket


@pytest.fixture
def door(tmp_path: Path) -> Iterator[socket.socket]:
    with listen(tmp_path / "endpoint.sock") as listener:
        yield listener


def test_both_sides_know_the_same_greeting() -> None:
    assert GREETING == unix_socket.GREETING


def test_the_greeting_is_waited_for_and_taken_away(door: socket.socket, tmp_path: Path) -> None:
    def serve() -> None:
        connection, _ = door.accept()
        with connection:
            connection.sendall(GREETING + b"and more")

    thread = threading.Thread(target=serve)
    thread.start()
    with greeted(tmp_path / "endpoint.sock", 20) as client:
        assert client.makefile("rb").read() == b"and more"
    thread.join()


@pytest.mark.parametrize("taken", [False, True])
def test_what_ends_before_its_greeting_is_nothing(door: socket.socket, tmp_path: Path, taken: bool) -> None:
    """The kernel connects also to who will never accept, and reports it once the last owner of the socket is gone."""

    def die() -> None:
        select.select([door], [], [])
        if taken:
            door.accept()[0].close()
        door.close()

    thread = threading.Thread(target=die)
    thread.start()
    with pytest.raises(ConnectionResetError):
        greeted(tmp_path / "endpoint.sock", 20)
    thread.join()
    with pytest.raises(ConnectionRefusedError):
        greeted(tmp_path / "endpoint.sock", 20)


def test_what_says_nothing_is_slow_and_not_gone(door: socket.socket, tmp_path: Path) -> None:
    with greeted(tmp_path / "endpoint.sock", 0.05) as client:
        connection, _ = door.accept()
        with connection:
            client.sendall(b"hello\n")
            assert connection.recv(100) == b"hello\n"


def test_a_late_greeting_does_not_reach_the_client() -> None:
    mine, its = socket.socketpair()
    stdin, stdout = os.pipe(), os.pipe()
    with its:
        its.sendall(GREETING + b"\n{}\n")
        its.shutdown(socket.SHUT_WR)
        with mine:
            assert not pipe(mine, stdin[0], stdout[1])
    assert os.read(stdout[0], 100) == b"\n{}\n"
    for descriptor in (*stdin, *stdout):
        os.close(descriptor)
