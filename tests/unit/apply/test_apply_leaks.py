"""Secrets are found in every spelling that would come out in clear, and ordinary words are left alone."""

import base64
import json
from pathlib import Path
from urllib.parse import quote

import pytest

from octoform.apply.stage.secret_scan import leaked, masked, without_secrets
from octoform.diagnostics import error, to_json
from octoform.harness.port import Task, TaskLimits

VALUE = 'k3y-"with"-ümlaut'


def task(stage: str = "identify", **environment: str) -> Task:
    folder = Path("/nowhere")
    names = ("prompt.md", "output.json", "agent.log", "task.json")
    prompt, output, log, document = (folder / name for name in names)
    return Task(
        stage=stage,
        attempt=1,
        workdir=folder,
        prompt=prompt,
        output=output,
        log=log,
        document=document,
        model=None,
        environment=environment or {"BENCH_KEY": VALUE},
        limits=TaskLimits(1.0),
        secrets=("BENCH_KEY", "NOT_SET"),
    )


ESCAPED = "".join(f"\\u{ord(sign):04x}" for sign in VALUE)


@pytest.mark.parametrize(
    "data",
    [
        json.dumps({"name": f"a {VALUE} b"}).encode(),
        json.dumps({"name": VALUE}, ensure_ascii=False).encode(),
        json.dumps([{VALUE: 1}]).encode(),
        f'{{"name": "{ESCAPED}"}}'.encode(),
        json.dumps({"at": "https://me:" + quote(VALUE) + "@host.invalid/"}).encode(),
        json.dumps({"header": "Basic " + base64.b64encode(f"me:{VALUE}".encode()).decode()}).encode(),
        f'{{"name": ["{ESCAPED[:30]}{VALUE[5:6]}{ESCAPED[36:]}"]}}'.encode(),
        b"no json at all: " + VALUE.encode(),
    ],
)
def test_a_value_in_json_is_found_however_it_is_spelt(data: bytes) -> None:
    found = [item for item in leaked(task(), data) if item.code == "APPLY-SECRET-IN-OUTPUT"]
    assert len(found) == 1
    assert "BENCH_KEY" in found[0].summary
    assert VALUE not in str(found[0])


@pytest.mark.parametrize(
    "source", [f"KEY = {VALUE!r}\n", f"KEY = {VALUE!a}\n", f"KEY = {VALUE.encode()!r}\n", f"# {VALUE}\n("]
)
def test_a_value_in_python_is_found_in_literals_and_comments(source: str) -> None:
    assert leaked(task("serve"), source.encode())


@pytest.mark.parametrize("data", [b"{}", b"", b"[" * 100_000, b"\xff\xfe", b'{"name": "k3y"}'])
def test_an_output_without_it_is_left_alone(data: bytes) -> None:
    assert leaked(task(), data) == []
    assert leaked(task("serve"), data) == []


def test_short_and_empty_values_are_ordinary_words() -> None:
    assert leaked(task(BENCH_KEY="debug"), b'{"mode": "debug"}') == []
    assert leaked(task(BENCH_KEY=""), b"{}") == []


MATERIAL = "b3BlbnNzaC1rZXktdjEAAAAABG5vbmUAAAAEbm9uZQAA"
KEY = f"-----BEGIN OPENSSH PRIVATE KEY-----\n{MATERIAL}\n-----END OPENSSH PRIVATE KEY-----"
LOOKS = [
    "Authorization: Bearer abc123",
    "authorization: basic bWU6cGFzcw==1",
    "bearer 0123456789abcdefghij",
    "sk-0123456789abcdef",
    "ghp_0123456789abcdef0123",
    "x-api-key: abc123",
    "https://me:pass@host.invalid/",
    KEY,
]


@pytest.mark.parametrize("text", LOOKS)
def test_what_looks_like_a_secret_is_refused_and_its_place_told(text: str) -> None:
    value = {"devices": [{"id": "a"}, {"a/b": f"x {text} y"}]}
    plain, escaped = json.dumps(value).encode(), json.dumps(value).replace("a", "\\u0061").encode()
    for data in (plain, escaped):
        found = leaked(task(), data)
        assert [(item.code, item.pointer) for item in found] == [("APPLY-CREDENTIAL-IN-OUTPUT", "/devices/1/a~1b")]
        assert text not in str(found[0])


@pytest.mark.parametrize("text", LOOKS)
def test_what_looks_like_a_secret_in_a_program(text: str) -> None:
    found = leaked(task("serve"), f"import os\n\nKEY = {text!r}\n".encode())
    assert [(item.code, item.span and item.span.line) for item in found] == [("APPLY-CREDENTIAL-IN-OUTPUT", 3)]
    assert leaked(task("serve"), f"# {text.partition(MATERIAL)[0] or text}{MATERIAL}\n(".encode())


@pytest.mark.parametrize(
    "source",
    [
        'headers = {"Authorization": f"Bearer {token}", "x-api-key": os.environ["LOOP_KEY_1"]}\n',
        'NAME = "-----BEGIN RSA PRIVATE KEY-----"\n',
        '"""Bearer authentication is the caller\'s; see https://host.invalid:8080/a@b."""\n',
        f"SERIAL = {'0123456789abcdef' * 4!r}\n",
    ],
)
def test_honest_programs_pass(source: str) -> None:
    assert leaked(task("serve"), source.encode()) == []


def test_many_places_are_bounded() -> None:
    data = json.dumps({"devices": ["sk-0123456789abcdef"] * 1000}).encode()
    assert 1 < len(leaked(task(), data)) <= 10


def test_diagnostics_that_quote_an_agent_are_redacted_in_every_field() -> None:
    message = f"it said {VALUE} and Authorization: Bearer abc.def.ghi"
    item = error("A-B", message, path=message, source=message, pointer=message, detail=message, hint=message)
    (clean,) = without_secrets(task(), [item])
    text = json.dumps(to_json(clean), ensure_ascii=False)
    assert VALUE not in text and json.dumps(VALUE)[1:-1] not in text and "abc.def" not in text
    assert text.count("[BENCH_KEY redacted]") == 6


def test_a_device_that_calls_itself_like_a_secret_is_blanked_out_and_keeps_no_host_from_being_onboarded() -> None:
    probe = task("probe")
    token = "ghp_" + "0123456789abcdef" * 2
    data = json.dumps({"devices": [{"id": "usb-1", "name": f"Acme {token} cam"}, {"id": "usb-2", "name": "lamp"}]})
    kept, found = masked(probe, data.encode())
    assert token not in kept.decode()
    names = [device["name"] for device in json.loads(kept)["devices"]]
    assert names[0].startswith("Acme ") and names[0].endswith(" cam") and names[1] == "lamp"
    assert [(item.code, item.severity.value, item.pointer) for item in found] == [
        ("APPLY-CREDENTIAL-IN-OUTPUT", "warning", "/devices/0/name")
    ]
    assert leaked(probe, kept) == []
    assert masked(task("identify"), data.encode()) == (data.encode(), [])
    assert masked(probe, b"no json") == (b"no json", [])
