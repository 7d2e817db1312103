"""Doctor's findings on programs, keys, APIs, models, prices and git, with real programs and APIs on loopback."""

import json
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest
from model_server import ModelServer, serve
from python_programs import python_program

from octoform.cli.main import main
from octoform.engine.doctor import Diagnosis, diagnose
from octoform.harness import doctor_checks
from octoform.harness.doctor_checks import Check, Status

SECRET = "loop-7f3c19d2a4"
NODE = "import sys; print('v22.20.0')"
PI = "print('0.87.1')"


@dataclass
class Bench:
    """A project and the machine around it: ``environ`` is all that octoform sees."""

    folder: Path
    environ: dict[str, str] = field(default_factory=dict)

    @property
    def bin(self) -> Path:
        return self.folder / "bin"

    def program(self, name: str, code: str) -> Path:
        return python_program(self.bin / name, code, "-IS")

    def manifest(self, *lines: str) -> None:
        (self.folder / "octopus.yaml").write_text("\n".join(("version: 1", "host: bench", *lines)) + "\n")

    def pi(self, url: str, *lines: str, more: str = "") -> None:
        """A manifest whose stages are all done by pi, with its model at ``url``."""
        harness = f'harness: {{name: pi, key: LOOP_KEY, base_url: "{url}"{more}}}'
        everywhere = [] if any(line.startswith("stages:") for line in lines) else [f"stages: {{probe: {{{harness}}}}}"]
        self.manifest(harness, "model: openai/scripted", *everywhere, *lines)

    def diagnose(self) -> Diagnosis:
        found = diagnose(self.folder, self.environ)
        assert SECRET not in repr(found)
        return found

    def checks(self) -> dict[str, Check]:
        """The checks of the only agent and of the machine, by name."""
        found = self.diagnose()
        assert len(found.groups) == 1, found
        named = {check.name: check for check in found.checks}
        assert len(named) == len(found.checks)
        return named

    def statuses(self) -> dict[str, str]:
        return {name: check.status.value for name, check in self.checks().items()}


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    made = Bench(tmp_path)
    made.environ = {"PATH": str(made.bin), "OCTOFORM_AGENTS": str(tmp_path / "agents"), "LOOP_KEY": SECRET}
    for name, code in (("git", ""), ("node", NODE), ("pi", PI)):
        made.program(name, code)
    return made


@pytest.fixture
def server() -> Iterator[ModelServer]:
    with serve({"turns": [{"text": "done"}], "models_key": SECRET}) as found:
        yield found


def test_all_is_well(bench: Bench, server: ModelServer) -> None:
    bench.pi(server.url, "budget: {usd: 1.0}", "prices: {openai/scripted: {input: 1, output: 2}}")
    found = bench.diagnose()
    assert found.ok
    expected = dict.fromkeys(("program", "version", "node", "key", "model API", "model", "price", "git"), Status.PASS)
    # No bubblewrap on this PATH, and none is required.
    assert {check.name: check.status for check in found.checks} == {**expected, "sandbox": Status.UNKNOWN}
    assert [(item["method"], item["path"], item["key"]) for item in server.requests] == [
        ("GET", "/v1/models", SECRET),
        ("GET", "/v1/models", None),
    ]
    assert found.groups[0].used_for == ("probe", "identify", "interface", "serve", "deploy", "watch", "heal")


@pytest.mark.parametrize(
    ("api", "path"),
    [
        ("openai-responses", "/v1/models"),
        ("anthropic-messages", "/v1/models"),
        ("gemini", "/v1beta/models"),
    ],
)
def test_each_api_is_asked_in_its_own_way(bench: Bench, server: ModelServer, api: str, path: str) -> None:
    bench.pi(server.url, more=f", api: {api}")
    assert {status for name, status in bench.statuses().items() if name != "sandbox"} == {"pass"}
    assert (server.requests[0]["path"], server.requests[0]["key"]) == (path, SECRET)


def test_a_key_that_is_refused(bench: Bench) -> None:
    with serve({"turns": [{"text": ""}], "models_status": 401}) as server:
        bench.pi(server.url)
        found = bench.checks()
    assert (found["key"].status, found["key"].detail) == (Status.FAIL, "LOOP_KEY was refused (401)")
    assert found["model API"].status is Status.PASS
    assert not bench.diagnose().ok


def test_an_api_that_lists_its_models_for_anybody_proves_no_key(bench: Bench) -> None:
    with serve([{"text": ""}]) as server:
        bench.pi(server.url)
        found = bench.diagnose()
    statuses = {check.name: check.status for check in found.checks}
    assert (statuses["key"], statuses["model API"], found.ok) == (Status.UNKNOWN, Status.PASS, True)


def test_no_key_no_question(bench: Bench, server: ModelServer) -> None:
    bench.pi(server.url)
    del bench.environ["LOOP_KEY"]
    found = bench.checks()
    assert (found["key"].status, found["key"].detail) == (Status.FAIL, "LOOP_KEY is not set")
    assert found["model API"].status is Status.UNKNOWN
    bench.environ["LOOP_KEY"] = "two\nlines"
    assert bench.statuses()["key"] == "fail"
    assert server.requests == []


def test_an_api_that_is_down(bench: Bench) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # bound and not listening: refused for certain
        bench.pi(f"http://127.0.0.1:{taken.getsockname()[1]}")
        found = bench.checks()
    assert (found["model API"].status, found["key"].status) == (Status.FAIL, Status.UNKNOWN)
    assert "Connection refused" in found["model API"].detail


@pytest.mark.parametrize("status", [404, 429, 500, 503])
def test_an_api_in_trouble_is_unknown(bench: Bench, status: int) -> None:
    with serve({"turns": [{"text": ""}], "models_status": status}) as server:
        bench.pi(server.url)
        found = bench.statuses()
    assert (found["model API"], found["key"]) == ("unknown", "unknown")


def test_an_api_that_does_not_answer(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor_checks, "SECONDS", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        bench.pi(f"http://127.0.0.1:{silent.getsockname()[1]}")
        assert "no answer within 0.2 s" in bench.checks()["model API"].detail


class Elsewhere(BaseHTTPRequestHandler):
    """Sends everybody to another server."""

    target = ""

    def do_GET(self) -> None:
        self.send_response(302)
        self.send_header("location", f"{self.target}/v1/models")
        self.send_header("content-length", "0")
        self.end_headers()

    def log_message(self, format: str, *arguments: object) -> None:
        pass


@contextmanager
def redirecting(target: str) -> Iterator[str]:
    httpd = HTTPServer(("127.0.0.1", 0), type("Handler", (Elsewhere,), {"target": target}))
    thread = threading.Thread(target=httpd.serve_forever, kwargs={"poll_interval": 0.05})
    thread.start()
    try:
        yield f"http://127.0.0.1:{httpd.server_address[1]}"
    finally:
        httpd.shutdown()
        thread.join()
        httpd.server_close()


def test_the_key_does_not_follow_a_redirect(bench: Bench, server: ModelServer) -> None:
    with redirecting(server.url) as url:
        bench.pi(url)
        assert bench.statuses()["model API"] == "unknown"
    assert server.requests == []


def test_a_proxy_is_used_only_where_the_agent_sees_it(bench: Bench, server: ModelServer) -> None:
    bench.environ["HTTP_PROXY"] = server.url
    bench.pi("http://models.invalid/v1")
    found = bench.checks()["model API"]
    assert found.status is Status.FAIL
    assert "HTTP_PROXY is set, but the agent does not see it" in (found.hint or "")
    assert server.requests == []
    bench.pi("http://models.invalid/v1", more=", env: [HTTP_PROXY]")
    assert {status for name, status in bench.statuses().items() if name != "sandbox"} == {"pass"}


def test_a_model_that_is_not_listed(bench: Bench, server: ModelServer) -> None:
    bench.manifest(f'harness: {{name: pi, key: LOOP_KEY, base_url: "{server.url}"}}', "model: openai/scriptd")
    (found,) = (check for check in bench.diagnose().checks if check.name == "model")
    assert (found.status, found.hint) == (Status.UNKNOWN, "did you mean 'scripted'?")


def test_a_budget_in_dollars_needs_a_price(bench: Bench, server: ModelServer) -> None:
    bench.pi(server.url)
    assert "price" not in bench.statuses()
    bench.pi(server.url, "budget: {usd: 1.0}")
    assert bench.statuses()["price"] == "fail"


@pytest.mark.parametrize(
    ("code", "status", "detail"),
    [
        ("print('pi 0.99.0')", "unknown", "0.99.0; octoform was tried with 0.87.1"),
        ("raise SystemExit('broken')", "fail", "pi --version: exit status 1: broken"),
    ],
)
def test_another_version(bench: Bench, server: ModelServer, code: str, status: str, detail: str) -> None:
    bench.program("pi", code)
    bench.pi(server.url)
    found = bench.checks()["version"]
    assert (found.status.value, found.detail) == (status, detail)


def test_a_program_that_is_nowhere(bench: Bench, server: ModelServer) -> None:
    (bench.bin / "pi").unlink()
    bench.pi(server.url)
    found = bench.checks()
    assert (found["program"].status, found["program"].hint) == (Status.FAIL, "octoform install pi")
    assert "version" not in found
    bench.pi(server.url, more=", command: [/no/such/pi]")
    assert "named in octopus.yaml" in bench.checks()["program"].detail


def test_the_node_of_a_program(bench: Bench, server: ModelServer) -> None:
    bench.program("node", "print('v20.1.0')")
    bench.pi(server.url)
    assert bench.checks()["node"].status is Status.UNKNOWN  # the one on PATH has started, so it may need none
    home = bench.folder / "agents" / "pi-0.87.1"
    (home / "node_modules" / ".bin").mkdir(parents=True)
    (home / "installed.json").write_text('{"format": 1, "node": null}')
    (home / "node_modules" / ".bin" / "pi").symlink_to(bench.bin / "pi")
    found = bench.checks()
    assert "installed by octoform" in found["program"].detail
    assert (found["node"].status, found["node"].hint) == (Status.FAIL, "octoform install pi brings one")


def test_every_agent_is_looked_at_once(bench: Bench, server: ModelServer) -> None:
    harness = f'{{name: pi, key: LOOP_KEY, base_url: "{server.url}"}}'
    bench.manifest(
        f"harness: {harness}",
        "model: openai/scripted",
        "stages:",
        "  probe: {harness: builtin}",
        f"  identify: {{harness: builtin, escalate: {{harness: {harness}, model: openai/dear}}}}",
        "  deploy: {harness: {name: command, command: [pi]}}",
        f'housekeeping: {{model: openai/scripted, key: LOOP_KEY, base_url: "{server.url}"}}',
    )
    found = bench.diagnose()
    assert [(group.harness, group.model, group.used_for) for group in found.groups] == [
        ("builtin", None, ("probe", "identify")),
        ("pi", "openai/dear", ("identify escalation",)),
        ("pi", "openai/scripted", ("interface", "serve", "watch", "heal")),
        ("command", "openai/scripted", ("deploy",)),
        ("litellm", "openai/scripted", ("housekeeping",)),
    ]
    assert [check.name for check in found.groups[3].checks] == ["program", "sandbox"]


def test_the_embedded_agent_needs_nothing(bench: Bench) -> None:
    bench.manifest()
    (bench.bin / "git").unlink()
    assert bench.statuses() == {"harness": "pass", "git": "unknown"}
    assert bench.diagnose().ok
    bench.manifest("git: {commit: true}")
    assert not bench.diagnose().ok


@pytest.mark.parametrize(("code", "status"), [("", "pass"), ("sys.exit('bwrap: not permitted')", "fail")])
def test_a_sandbox_has_to_work(bench: Bench, server: ModelServer, code: str, status: str) -> None:
    bench.pi(server.url, more=", sandbox: true")
    assert "bubblewrap" in (bench.checks()["sandbox"].hint or "")
    bench.program("bwrap", f"import sys\n{code}")
    assert bench.statuses()["sandbox"] == status
    bench.pi(server.url)
    assert bench.statuses()["sandbox"] == ("pass" if status == "pass" else "unknown")
    bench.pi(server.url, more=", sandbox: false")
    assert bench.statuses()["sandbox"] == "unknown"
    assert "`sandbox: false`" in bench.checks()["sandbox"].detail


def test_a_recording_has_to_be_one(bench: Bench) -> None:
    folder = bench.folder / "recordings" / "bench"
    folder.mkdir(parents=True)
    bench.manifest("harness: {name: replay, recording: recordings/bench}")
    assert bench.statuses()["recording"] == "fail"
    (folder / "recording.json").write_text('{"format": 1, "octoform": "0.1.0", "stages": {}}')
    assert bench.statuses()["recording"] == "pass"


def test_the_command_line(bench: Bench, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    for name, value in bench.environ.items():
        monkeypatch.setenv(name, value)
    bench.manifest()
    assert main(["-chdir", str(bench.folder), "doctor"]) == 0
    assert "pass     harness    comes with octoform" in capsys.readouterr().out
    bench.manifest("harness: {name: command, command: [/no/such/agent]}")
    assert main(["-chdir", str(bench.folder), "doctor"]) == 1
    assert "help: correct `command` in octopus.yaml" in capsys.readouterr().out
    assert main(["-chdir", str(bench.folder), "doctor", "-json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert (document["format"], document["ok"]) == (1, False)
    assert [check["status"] for check in document["agents"][0]["checks"]][:1] == ["fail"]
    bench.manifest("harness: nonsense")
    assert main(["-chdir", str(bench.folder), "doctor"]) == 1
    assert "nonsense" in capsys.readouterr().err


def test_the_program_of_the_tunnel_is_looked_for_in_scope_internet_alone(tmp_path: Path) -> None:
    bench = Bench(tmp_path, {"PATH": str(tmp_path / "bin")})
    bench.manifest("harness: builtin", "scope: internet")
    (found,) = [check for check in diagnose(bench.folder, bench.environ).machine if check.name == "tunnel"]
    assert (found.status, found.detail) == (Status.FAIL, "there is no program 'cloudflared'")
    assert found.hint is not None and "tunnel.command" in found.hint
    bench.program("my-tunnel", "")
    bench.manifest("harness: builtin", "scope: internet", 'tunnel: {command: [my-tunnel, --to, "{url}"]}')
    (found,) = [check for check in diagnose(bench.folder, bench.environ).machine if check.name == "tunnel"]
    assert (found.status, found.detail) == (Status.PASS, str(bench.bin / "my-tunnel"))
    bench.manifest("harness: builtin")
    assert [check.name for check in diagnose(bench.folder, bench.environ).machine] == ["git"]
