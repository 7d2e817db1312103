"""The tunnel of scope internet: started, shown, kept, ended with its server, revoked with proof."""

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from web_doors import ALL, INSTANCE, Door, door, until, write_tokens

from octoform.base.clock import boot_id
from octoform.server import tunnel_process as tunnel
from octoform.server import tunnel_termination
from octoform.server.tunnel_process import Tunnel, public_address

PROGRAM = str(Path(__file__).parents[2] / "support" / "local_tunnel.py")
LOCAL = "http://127.0.0.1:7777"


@dataclass
class Opened:
    tunnel: Tunnel
    door: Door
    urls: list[str | None] = field(default_factory=list)

    @property
    def run(self) -> Path:
        return self.door.run

    @property
    def url(self) -> str:
        until(lambda: self.tunnel.status()["state"] == "running")
        return str(self.tunnel.status()["url"])

    def reason(self) -> str:
        until(lambda: self.tunnel.status()["state"] == "not running")
        return str(self.tunnel.status()["reason"])


@contextmanager
def opened(folder: Path, *options: str, command: Sequence[str] | None = None) -> Iterator[Opened]:
    (folder / "run").mkdir(exist_ok=True)
    write_tokens(folder / "run", {"all": ("secret", ALL, None)})
    with door(folder) as found:
        urls: list[str | None] = []

        def changed(url: str | None) -> None:
            urls.append(url)
            found.web.published(url)

        given = list(command or [sys.executable, PROGRAM, *options, "{url}"])
        made = Tunnel(given, found.run, local_url=f"http://127.0.0.1:{found.port}", instance=INSTANCE, changed=changed)
        made.start()
        try:
            yield Opened(made, found, urls)
        finally:
            made.stop()
            assert not alive(found.run)


def alive(run: Path) -> list[int]:
    record = tunnel_termination.read(run)
    return [] if record is None else list(tunnel_termination.members(record))


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tunnel, "FIRST_DELAY", 0.1)


def test_refusal_through_the_tunnel_is_an_answer(tmp_path: Path) -> None:
    with opened(tmp_path) as found:
        url = found.url
        found.door.web.published(None)
        assert found.door.ask("GET", "/health", headers={"Host": url.removeprefix("http://")})[0] == 421
        assert tunnel_termination.answers(url, INSTANCE)
        assert not tunnel_termination.answers(url, "of-another-start")


@pytest.mark.parametrize("options", [(), ("--child",)])
def test_public_address_leads_here_until_it_is_revoked(tmp_path: Path, options: tuple[str, ...]) -> None:
    with opened(tmp_path, *options) as found:
        url = found.url
        assert tunnel_termination.answers(url, INSTANCE)
        assert json.loads((found.run / "tunnel.json").read_text())["url"] == url
        assert len(alive(found.run)) == 2 + len(options)
        proof = found.tunnel.revoke()
        assert (proof.proved, proof.was_running, proof.process_gone) == (True, True, True)
        assert (proof.answered_before, proof.answers, proof.url) == (True, False, url)
        assert not alive(found.run)
        assert not tunnel_termination.answers(url, INSTANCE)
        until(lambda: found.tunnel.status()["state"] == "revoked")
        time.sleep(tunnel.LOOK_SECONDS * 3)
        assert (found.tunnel.status()["starts"], alive(found.run)) == (1, [])
        # The door itself goes on.
        assert found.door.ask("GET", "/health")[0] == 200
        host = url.removeprefix("http://")
        assert found.door.ask("GET", "/health", headers={"Host": host})[0] == 421


@pytest.mark.parametrize("options", [("--apart",), ("--apart", "--filter")])
def test_worker_that_left_the_group_and_its_parent_is_ended(tmp_path: Path, options: tuple[str, ...]) -> None:
    with opened(tmp_path, *options) as found:
        url = found.url
        assert tunnel_termination.answers(url, INSTANCE)
        record = tunnel_termination.read(found.run)
        assert record is not None
        workers = [pid for pid in alive(found.run) if os.getpgid(pid) != record["pid"]]
        assert len(workers) == 1
        proof = found.tunnel.revoke()
        assert (proof.proved, proof.process_gone, proof.known, proof.answers) == (True, True, True, False)
        assert tunnel_termination._stat(workers[0]) is None


def test_worker_apart_goes_with_its_server_and_does_not_outlive_it(tmp_path: Path) -> None:
    with opened(tmp_path, "--apart") as found:
        url = found.url
    assert not tunnel_termination.answers(url, INSTANCE)


def test_what_another_start_left_behind_is_ended_first(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    environment = {**os.environ, tunnel_termination.MARK: "f" * 16}
    left = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"], env=environment)
    try:
        record = {"pid": 1 << 22, "start": 1, "boot": boot_id(), "mark": "f" * 16, "instance": "before", "url": None}
        (tmp_path / "run" / "tunnel.json").write_text(json.dumps(record))
        with opened(tmp_path) as found:
            assert found.url
            assert left.wait(10) == -signal.SIGTERM
    finally:
        left.kill()
        left.wait()


@pytest.mark.parametrize("options", [(), ("--filter",)])
def test_refusal_through_a_tunnel_that_filters_headers_is_an_answer_too(
    tmp_path: Path, options: tuple[str, ...]
) -> None:
    with opened(tmp_path, *options) as found:
        url = found.url
        assert tunnel_termination.answers(url, INSTANCE)
        found.door.web.published(None)
        assert tunnel_termination.answers(url, INSTANCE)
        assert not tunnel_termination.answers(url, "of-another-start")


def gone_tunnel(run: Path, **more: object) -> None:
    """The record of a tunnel whose processes have ended, and whose address does not answer."""
    url = "http://words.localhost:9"
    record = {"pid": 1 << 22, "start": 1, "boot": boot_id(), "mark": "0" * 16, "instance": INSTANCE, "url": url, **more}
    (run / "tunnel.json").write_text(json.dumps(record))


def test_silence_of_an_address_that_was_never_heard_is_no_proof(tmp_path: Path) -> None:
    gone_tunnel(tmp_path)
    proof = tunnel_termination.revoke(tmp_path)
    assert (proof.process_gone, proof.answers, proof.known, proof.proved) == (True, False, False, False)


def test_silence_of_an_address_that_was_heard_once_is_proof(tmp_path: Path) -> None:
    gone_tunnel(tmp_path, answered=True)
    proof = tunnel_termination.revoke(tmp_path)
    assert (proof.answered_before, proof.answers, proof.known, proof.proved) == (False, False, True, True)


def test_address_is_heard_while_the_tunnel_runs_and_that_stays_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tunnel, "HEAR_SECONDS", (0.01,) * 100)
    with opened(tmp_path) as found:
        assert found.url
        until(lambda: bool((tunnel_termination.read(found.run) or {}).get("answered")))
        found.tunnel.stop()
        assert tunnel_termination.revoke(found.run).proved


def test_revoked_tunnel_stays_so_until_it_is_allowed(tmp_path: Path) -> None:
    with opened(tmp_path) as found:
        assert found.url
        found.tunnel.revoke()
    with opened(tmp_path) as found:
        until(lambda: found.tunnel.status()["state"] == "revoked")
        assert found.tunnel.status()["starts"] == 0
        (found.run / "tunnel-revoked.json").unlink()
        assert tunnel_termination.answers(found.url, INSTANCE)


def test_program_that_ends_is_started_again_at_a_new_address(tmp_path: Path) -> None:
    with opened(tmp_path) as found:
        first = found.url
        (_, child) = sorted(alive(found.run))
        os.kill(child, signal.SIGKILL)
        until(lambda: found.tunnel.status()["url"] not in (first, None))
        second = found.url
        assert tunnel_termination.answers(second, INSTANCE)
        assert not tunnel_termination.answers(first, INSTANCE)
        assert found.urls == [first, None, second]
        # The name of the former address is free.
        status, _, _ = found.door.ask("GET", "/health", headers={"Host": first.removeprefix("http://")})
        assert status == 421


def test_reason_is_told_when_there_is_no_program(tmp_path: Path) -> None:
    with opened(tmp_path, command=["no-such-tunnel-program", "{url}"]) as found:
        assert found.reason() == (
            "there is no program 'no-such-tunnel-program'; install it, or name another as tunnel.command"
        )
        assert found.door.ask("GET", "/health")[0] == 200
        assert found.tunnel.revoke().proved


def test_reason_is_told_when_the_program_ends(tmp_path: Path) -> None:
    with opened(tmp_path, "--exit", "5") as found:
        assert found.reason().endswith("ended with status 5: ERR failed to request a tunnel: no network")
        assert found.urls[0] is None
        assert found.door.ask("GET", "/health")[0] == 200


def test_program_that_cannot_be_started(tmp_path: Path) -> None:
    broken = tmp_path / "broken"
    broken.write_text("#!/nonexistent/interpreter\n")
    broken.chmod(0o755)
    with opened(tmp_path, command=[str(broken), "{url}"]) as found:
        assert "ended with status 127" in found.reason()


def test_program_that_prints_without_end_is_read_and_not_kept(tmp_path: Path) -> None:
    noise = "import sys\nwhile True: sys.stdout.write('x' * 100000)"
    with opened(tmp_path, command=[sys.executable, "-c", noise]) as found:
        until(lambda: found.tunnel.status()["starts"] == 1)
        assert found.door.ask("GET", "/health")[0] == 200
        assert found.tunnel.revoke().proved


def test_program_that_ignores_the_word_to_stop_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tunnel_termination, "GRACE_SECONDS", 0.3)
    deaf = (
        "import signal, time\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\nprint('deaf', flush=True)\ntime.sleep(60)"
    )
    with opened(tmp_path, command=[sys.executable, "-c", deaf]) as found:
        until(lambda: len(alive(found.run)) == 2)
        assert found.tunnel.revoke().proved


def test_address_that_goes_on_answering_is_no_proof(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tunnel_termination, "PROOF_SECONDS", 0.5)
    with opened(tmp_path) as found:
        assert found.url
        record = json.loads((found.run / "tunnel.json").read_text())
        # As if the provider kept the address alive somewhere else: the door itself answers there.
        record["url"] = f"http://127.0.0.1:{found.door.port}"
        (found.run / "tunnel.json").write_text(json.dumps(record))
        proof = found.tunnel.revoke()
        assert (proof.process_gone, proof.answers, proof.proved) == (True, True, False)


def test_another_process_with_that_number_is_left_alone(tmp_path: Path) -> None:
    stranger = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"], start_new_session=True)
    try:
        record = {
            "pid": stranger.pid,
            "start": 1,
            "boot": Path("/proc/sys/kernel/random/boot_id").read_text().strip(),
            "mark": "0" * 16,
            "instance": INSTANCE,
            "url": None,
        }
        (tmp_path / "tunnel.json").write_text(json.dumps(record))
        proof = tunnel_termination.revoke(tmp_path)
        assert (proof.was_running, proof.process_gone, proof.proved) == (False, True, True)
        assert stranger.poll() is None
    finally:
        stranger.kill()
        stranger.wait()


def test_nothing_was_ever_open(tmp_path: Path) -> None:
    assert tunnel_termination.revoke(tmp_path).proved
    assert tunnel_termination.forbidden(tmp_path)


SERVER = """
import sys, time
from pathlib import Path
from octoform.server.tunnel_process import Tunnel
made = Tunnel(sys.argv[2:], Path(sys.argv[1]), local_url="http://127.0.0.1:9", instance="i", changed=lambda url: None)
made.start()
time.sleep(120)
"""


@pytest.mark.parametrize("options", [(), ("--child",)])
def test_killed_server_takes_the_tunnel_along(tmp_path: Path, options: tuple[str, ...]) -> None:
    command = [sys.executable, "-c", textwrap.dedent(SERVER), str(tmp_path), sys.executable, PROGRAM, *options, "{url}"]
    server = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    try:
        until(lambda: bool((tunnel_termination.read(tmp_path) or {}).get("url")))
        assert len(alive(tmp_path)) == 2 + len(options)
    finally:
        server.kill()
        server.wait()
    until(lambda: not alive(tmp_path))


def test_killed_warden_takes_the_tunnel_along(tmp_path: Path) -> None:
    with opened(tmp_path) as found:
        first = found.url
        warden = json.loads((found.run / "tunnel.json").read_text())["pid"]
        os.kill(warden, signal.SIGKILL)
        until(lambda: found.tunnel.status()["url"] not in (first, None))
        assert not tunnel_termination.answers(first, INSTANCE)


QUICK = """
2026-07-30T10:00:00Z INF Thank you. ... subject to the Terms of Use (https://www.example.com/website-terms/), and ...
2026-07-30T10:00:00Z INF you should use a named tunnel: https://developers.example.com/one/connections/connect-apps
2026-07-30T10:00:01Z ERR failed to request quick Tunnel: Post "https://api.example.com/tunnel": context deadline
2026-07-30T10:00:02Z INF +----------------------------------------------------------+
2026-07-30T10:00:02Z INF |  https://four-random-plain-words.tunnels.example.com    |
2026-07-30T10:00:02Z INF Settings: map[ha-connections:1 no-autoupdate:true url:http://127.0.0.1:7777]
"""


def test_address_is_found_among_the_others_that_are_printed() -> None:
    found = [public_address(line, LOCAL) for line in QUICK.splitlines()]
    assert [url for url in found if url] == ["https://four-random-plain-words.tunnels.example.com"]


@pytest.mark.parametrize(
    ("line", "url"),
    [
        ("your url is: https://words.example.net", "https://words.example.net"),
        (
            'lvl=info msg="started tunnel" addr=http://localhost:7777 url=https://a1b2.example.app',
            "https://a1b2.example.app",
        ),
        ("Forwarding HTTP traffic from \x1b[32mhttps://x.example.net\x1b[0m", "https://x.example.net"),
        ("see (https://x.example.net).", "https://x.example.net"),
        ("https://X.Example.net/", "https://x.example.net"),
        ("http://public.example.net:8080", "http://public.example.net:8080"),
        ("web interface http://127.0.0.1:4040", None),
        ("web interface http://[::1]:4040/", None),
        ("http://0.0.0.0:7777", None),
        ("https://user:secret@x.example.net", None),
        ("https://x.example.net/path", None),
        ("https://x.example.net?query", None),
        ("https://x.example.net:99999", None),
        ("https://bad_host*.example.net", None),
        ("https://", None),
        ("nothing here", None),
    ],
)
def test_address_of_a_line(line: str, url: str | None) -> None:
    assert public_address(line, LOCAL) == url
