"""A tunnel program for tests: it opens an address of its own and forwards it, as quick tunnels do, all on loopback.

    python local_tunnel.py [--child] [--apart] [--filter] [--silent] [--exit STATUS] [--after SECONDS] URL

It prints what such programs print before the address: terms, documentation, the address that it was given. ``--child``
does the work in a process of its own below this one, ``--apart`` in one that leaves the group and loses its parent,
``--filter`` passes on no header that it does not know, ``--silent`` prints no address, ``--exit`` ends at once, and
``--after`` ends after so long.
"""

import argparse
import re
import secrets
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress
from urllib.parse import urlsplit

UNKNOWN = re.compile(rb"octoform-[^:]*:[^\r]*\r\n", re.IGNORECASE)


def pump(source: socket.socket, target: socket.socket, filtering: bool) -> None:
    with suppress(OSError):
        while data := source.recv(65536):
            target.sendall(UNKNOWN.sub(b"", data) if filtering else data)
    for one in (source, target):
        with suppress(OSError):
            one.shutdown(socket.SHUT_RDWR)


def forward(listener: socket.socket, target: tuple[str, int], filtering: bool) -> None:
    while True:
        outside, _ = listener.accept()
        try:
            inside = socket.create_connection(target)
        except OSError:
            outside.close()
            continue
        for pair in ((outside, inside), (inside, outside)):
            threading.Thread(target=pump, args=(*pair, filtering), daemon=True).start()


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--child", action="store_true")
    parser.add_argument("--apart", action="store_true")
    parser.add_argument("--filter", action="store_true")
    parser.add_argument("--silent", action="store_true")
    parser.add_argument("--exit", type=int)
    parser.add_argument("--after", type=float)
    parser.add_argument("url")
    given = parser.parse_args()
    if given.child:
        rest = [word for word in sys.argv[1:] if word != "--child"]
        return subprocess.Popen([sys.executable, __file__, *rest], start_new_session=False).wait()
    if given.apart:
        rest = [word for word in sys.argv[1:] if word != "--apart"]
        start = f"import subprocess; subprocess.Popen({[sys.executable, __file__, *rest]!r}, start_new_session=True)"
        subprocess.run([sys.executable, "-c", start], check=True)
        time.sleep(1000)
    print("INF subject to the terms of use (https://www.example.com/website-terms/), see:", file=sys.stderr)
    print("INF https://developers.example.com/tunnels/do-more", file=sys.stderr)
    print(f"INF Settings: map[url:{given.url}] metrics at http://127.0.0.1:20241", file=sys.stderr, flush=True)
    if given.exit is not None:
        print("ERR failed to request a tunnel: no network", file=sys.stderr, flush=True)
        return int(given.exit)
    listener = socket.create_server(("127.0.0.1", 0))
    address = f"http://{secrets.token_hex(4)}.localhost:{listener.getsockname()[1]}"
    if not given.silent:
        print(f"\x1b[90mINF\x1b[0m |  {address}   |", file=sys.stderr, flush=True)
    parts = urlsplit(given.url)
    work = threading.Thread(target=forward, args=(listener, (parts.hostname, parts.port), given.filter), daemon=True)
    work.start()
    if given.after is not None:
        time.sleep(given.after)
        return 3
    work.join()
    return 0


if __name__ == "__main__":
    sys.exit(main())
