"""Delivery of alerts: no receiver holds the daemon up, nothing is lost in silence, and no secret is ever sent."""

import json
import os
import stat
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest
from python_programs import python_program

from octoform.daemon import notices, webhook
from octoform.daemon.model import Alert
from octoform.daemon.notices import Command, Desktop, Failing, Notifier, Webhook, failing, open_notifier
from octoform.daemon.store.json_store import Shelf
from octoform.manifest.model import Notify
from octoform.state.layout import Layout

ALERT = Alert("frozen", "bench", "endpoint", "its process \x1b[31mis gone", "2026-11-22T03:12:40Z", "octoform health")
SECRET = "T0P-SECRET-PATH"


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    return Layout(tmp_path, "bench")


def told(notifier: Notifier) -> None:
    """Everything that waits is delivered."""
    notifier.close(30.0)


def at_once(_: float) -> bool:
    return False


def test_a_program_gets_the_alert_and_next_to_nothing_of_the_environment(tmp_path: Path) -> None:
    python_program(
        tmp_path / "tell",
        "import json, os, sys\n"
        "told = [sys.argv[1:], json.load(sys.stdin), sorted(os.environ), os.getcwd()]\n"
        "print(json.dumps(told), file=open('out', 'w'))",
    )
    environ = {"PATH": os.environ["PATH"], "HOME": "/root", "API_KEY": SECRET, "LC_CTYPE": "C.UTF-8"}
    assert Command(("./tell", "${X} {y}", "a b"), tmp_path, environ)(ALERT) is None
    argv, document, names, folder = json.loads((tmp_path / "out").read_text())
    assert argv == ["${X} {y}", "a b"]
    assert document == {
        "format": 1,
        "octoform": "alert",
        "event": "frozen",
        "host": "bench",
        "target": "endpoint",
        "summary": "its process \\x1b[31mis gone",
        "stamp": "2026-11-22T03:12:40Z",
        "hint": "octoform health",
    }
    own = {"LC_CTYPE", "PWD", "OLDPWD", "SHLVL", "_"}  # set by Python, and by the shell that starts it
    assert set(names) <= {"PATH", "HOME"} | own
    assert folder == str(tmp_path)


@pytest.mark.parametrize(
    ("argv", "why"),
    [
        (("/no/such/program",), "program cannot be started: No such file or directory"),
        (("/bin/sh", "-c", "echo first; echo it is full >&2; exit 3"), "it ended with status 3: it is full"),
        (
            ("/bin/sh", "-c", "echo 'sk-ant-api03-EXAMPLEEXAMPLEEXAMPLEEXAMPLE' >&2; exit 1"),
            "it ended with status 1: ***",
        ),
        (
            ("/bin/sh", "-c", "head -c 3000000 /dev/zero >&2; echo >&2; echo end >&2; exit 1"),
            "it ended with status 1: end",
        ),
        (("/bin/sh", "-c", "exec 2>&-; sleep 0.1; exit 5"), "it ended with status 5"),
    ],
)
def test_why_a_program_failed_is_bounded_and_redacted(argv: tuple[str, ...], why: str, tmp_path: Path) -> None:
    found = Command(argv, tmp_path, os.environ)(ALERT)
    assert found is not None
    assert found.startswith(why)
    assert "EXAMPLE" not in found
    assert len(found) < 300


def test_a_program_that_hangs_is_ended_with_all_that_it_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(notices, "SECONDS", 0.3)
    script = "sleep 60 & echo $! > child; while :; do echo and on >&2; done"
    assert Command(("/bin/sh", "-c", script), tmp_path, os.environ)(ALERT) == "it took more than 0.3 s and was ended"
    child = int((tmp_path / "child").read_text())
    state = Path(f"/proc/{child}/stat")
    deadline = time.monotonic() + 5
    while state.exists() and state.read_text().rpartition(")")[2].split()[0] != "Z":
        assert time.monotonic() < deadline


@contextmanager
def website(answer: Callable[[BaseHTTPRequestHandler], None]) -> Iterator[tuple[str, list[tuple[str, bytes]]]]:
    """A web server on loopback: its URL, and what it was posted."""
    got: list[tuple[str, bytes]] = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            got.append((self.path, self.rfile.read(int(self.headers["Content-Length"]))))
            answer(self)

        def do_GET(self) -> None:
            got.append((self.path, b"GET"))
            answer(self)

        def log_message(self, *_: object) -> None:
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.02,))
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}", got
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def answered(code: int, **headers: str) -> Callable[[BaseHTTPRequestHandler], None]:
    def answer(handler: BaseHTTPRequestHandler) -> None:
        handler.send_response(code)
        for name, value in headers.items():
            handler.send_header(name, value)
        handler.send_header("Content-Length", "0")
        handler.end_headers()

    return answer


def test_a_webhook_is_posted_to_and_its_url_is_only_a_reference() -> None:
    with website(answered(204)) as (url, got):
        hook = Webhook("${HOOK}", {"HOOK": f"{url}/{SECRET}", "PATH": os.environ["PATH"]})
        assert hook(ALERT) is None
    ((path, body),) = got
    assert path == f"/{SECRET}"
    assert json.loads(body)["target"] == "endpoint"


@pytest.mark.parametrize(
    ("code", "why"), [(404, "it answered with 404"), (500, "it answered with 500"), (302, "it answered with 302")]
)
def test_a_webhook_that_refuses_or_sends_elsewhere_has_failed(code: int, why: str) -> None:
    with website(answered(code, Location=f"http://127.0.0.1:1/{SECRET}")) as (url, got):
        found = webhook.post(f"{url}/{SECRET}", {}, 5.0)
    assert found == why
    assert len(got) == 1


@pytest.mark.parametrize(
    "url",
    [f"http://127.0.0.1:1/{SECRET}", f"http://[{SECRET}", f"file:///{SECRET}", f"{SECRET}", f"http://a b/{SECRET}\n"],
)
def test_what_is_said_of_a_webhook_never_holds_its_url(url: str) -> None:
    found = webhook.post(url, {}, 5.0)
    assert found is not None
    assert SECRET not in found


def test_a_webhook_without_its_variable_says_so() -> None:
    assert Webhook("https://${HOST}/x", {})(ALERT) == "the variable HOST is not set"


def test_the_desktop_is_told_without_markup(tmp_path: Path) -> None:
    program = tmp_path / "notify-send"
    program.write_text(f'#!/bin/sh\nprintf "%s\\n" "$@" > {tmp_path}/out\n')
    program.chmod(0o755)
    alert = Alert("opened", "bench", "tool:x", "<b>-bold</b> & more", "2026-11-22T03:12:40Z")
    assert Desktop({"PATH": f"{tmp_path}:{os.environ['PATH']}"})(alert) is None
    assert (tmp_path / "out").read_text().splitlines() == [
        "--app-name=octoform",
        "--urgency=normal",
        "--",
        "octoform bench: opened tool:x",
        "&lt;b&gt;-bold&lt;/b&gt; &amp; more",
    ]


def test_a_message_that_fails_is_tried_again_and_then_said(layout: Layout) -> None:
    tries: list[str] = []

    def deliver(alert: Alert) -> str | None:
        tries.append(alert.target)
        return "no route"

    waited: list[float] = []

    def wait(seconds: float) -> bool:
        waited.append(seconds)
        return False

    notifier = Notifier({"webhook": deliver}, Shelf(layout), wait)
    notifier(ALERT)
    while not failing(layout):
        time.sleep(0.01)
    told(notifier)
    assert waited == list(notices.WAITS)
    assert tries == ["endpoint"] * 3
    assert failing(layout) == (Failing("webhook", "2026-11-22T03:12:40Z", "no route", 1),)
    file = layout.daemon / notices.FILE
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    again = Notifier({"webhook": lambda _: None}, Shelf(layout), at_once)
    again(ALERT)
    told(again)
    assert failing(layout) == ()


def test_nobody_waits_for_a_way_that_hangs_and_the_others_are_told(layout: Layout) -> None:
    gate, heard = threading.Event(), threading.Event()

    def hangs(_: Alert) -> str | None:
        gate.wait(30)
        return None

    def hears(_: Alert) -> str | None:
        heard.set()
        return None

    notifier = Notifier({"command": hangs, "webhook": hears}, Shelf(layout), at_once)
    began = time.monotonic()
    for _ in range(notices.MAX_WAITING + 10):
        notifier(ALERT)
    assert heard.wait(10)
    notifier.close(0.2)
    assert time.monotonic() - began < 8
    (lost,) = failing(layout)
    gate.set()
    assert lost.way == "command"
    assert lost.lost >= notices.MAX_WAITING
    assert lost.why == "the daemon ended before it was sent"


def test_only_what_the_manifest_names_is_a_way_and_a_quiet_daemon_has_no_thread(layout: Layout) -> None:
    before = threading.active_count()
    quiet = open_notifier(layout, Notify(), {})
    quiet(ALERT)
    named = open_notifier(layout, Notify(("true",), "https://x.example/y", desktop=True), {})
    assert threading.active_count() == before
    told(quiet)
    told(named)
    assert not layout.daemon.exists()


@pytest.mark.parametrize("text", ["", "{", "[]", '{"ways": 3}', '{"ways": {"x": {}}}', "[" * 5000])
def test_a_damaged_record_tells_nothing_and_breaks_nothing(layout: Layout, text: str) -> None:
    layout.daemon.mkdir(parents=True)
    (layout.daemon / notices.FILE).write_text(text)
    assert failing(layout) == ()
