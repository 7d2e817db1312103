"""Secrets are found in every spelling that would come out in clear, and ordinary words are left alone."""

import json
from pathlib import Path

import pytest

from octoform.apply.leaks import leaked
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
        f'{{"name": ["{ESCAPED[:30]}{VALUE[5:6]}{ESCAPED[36:]}"]}}'.encode(),
        b"no json at all: " + VALUE.encode(),
    ],
)
def test_a_value_in_json_is_found_however_it_is_spelt(data: bytes) -> None:
    found = leaked(task(), data)
    assert [item.code for item in found] == ["APPLY-SECRET-IN-OUTPUT"]
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
