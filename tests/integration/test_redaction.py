"""What an agent was given to log in with, and what looks like it, is in nothing that a run keeps or shows."""

import base64
import json
from pathlib import Path

from bench_host import ADAPTER, bench_host
from projects import Project

KEY = "loop-Key/7f3c19+d2a4 x"
TOKEN = "sk-0123456789abcdefghij"
PEM = "-----BEGIN OPENSSH PRIVATE KEY-----\n" + "b3BlbnNzaC1rZXktdjEAAAAA\n" * 5 + "-----END OPENSSH PRIVATE KEY-----"
BASIC = base64.b64encode(f"me:{KEY}".encode()).decode()
BEARER = "abc.DEF-0123456789"
SERIAL = "serial 4C530001230918115243"
SAID = f"> authorization: Basic {BASIC}\n> Authorization: BEARER {BEARER}\nseen {TOKEN}\n{PEM}\n{SERIAL}"


def test_a_failed_attempt_and_its_retry_keep_no_secret(project: Project) -> None:
    project.environ = {"BENCH_KEY": KEY}
    project.env = ["BENCH_KEY"]
    project.script = {
        "probe": [
            {"echo": "BENCH_KEY", "say": SAID, "exit": 3, "touch": [str(project.folder / f"{TOKEN}.txt")]},
            {"echo": "BENCH_KEY", "write": json.dumps({"format": 1, KEY: TOKEN})},
            {"mutate": [[["devices", 1, "raw_descriptor"], f"product: {TOKEN}"]]},
        ]
    }
    host = bench_host(project.outside / "host")
    (host / "sys/devices" / ADAPTER / "product").write_text(f"USB Serial {TOKEN}\n")
    done = project.apply("-target", "probe", status=0)
    assert {"APPLY-AGENT-FAILED", "APPLY-OUTSIDE-WRITE", "APPLY-SECRET-IN-OUTPUT", "APPLY-CREDENTIAL-IN-OUTPUT"} <= set(
        done.codes()
    )
    kept = [path for path in project.folder.rglob("*") if path.is_file()]
    assert {"agent.log", "prompt.md", "attempt.json", "task.json"} <= {path.name for path in kept}
    shown = {Path("the stream"): done.text.encode(), **{path: path.read_bytes() for path in kept}}
    for secret in (KEY, json.dumps(KEY)[1:-1].replace("/", "\\/"), BASIC, BEARER, TOKEN, "b3BlbnNz"):
        assert [path for path, data in shown.items() if secret.encode() in data] == [], secret
    assert "redacted" in (project.state / "probe" / "output.json").read_text(), "the device's own text was blanked out"
    log = project.attempts("probe")[0] / "agent.log"
    assert "[BENCH_KEY redacted]" in log.read_text()
    assert SERIAL in log.read_text()
