"""Tokens as a person makes and ends them, and what the serving process makes of them."""

import contextlib
import json
import os
import stat
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from octoform.cli.main import main
from octoform.diagnostics import Severity
from octoform.endpoint.access import tokens
from octoform.engine.safety import person
from octoform.server.transport.authentication import Tokens
from octoform.state.layout import Layout

MANIFEST = "version: 1\nhost: bench\nharness: builtin\nscope: intranet\n"


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    return Layout(tmp_path, "bench")


@pytest.fixture
def project(tmp_path: Path) -> Path:
    (tmp_path / "octopus.yaml").write_text(MANIFEST)
    return tmp_path


def octoform(project: Path, *words: str) -> int:
    return main([f"-chdir={project}", *words])


def served(layout: Layout) -> Tokens:
    return Tokens(layout.run / "tokens.json")


def made(layout: Layout, name: str, effects: Sequence[str] = ("read",), seconds: float | None = None) -> str:
    found, problems = tokens.create(layout, name, effects, seconds)
    assert found is not None, problems
    return found.value


def test_value_opens_the_door_until_the_token_ends(layout: Layout) -> None:
    door = served(layout)
    assert door.find("anything") is None
    value = made(layout, "laptop", ("actuate", "read"))
    found = door.find(value)
    assert found is not None
    assert (found.name, set(found.effects), found.expires) == ("laptop", {"read", "actuate"}, None)
    assert door.find(value + "x") is None
    second, problems = tokens.rotate(layout, "laptop", "test")
    assert second is not None, problems
    assert second.value != value
    assert (door.find(value), door.find(second.value) is not None) == (None, True)
    assert tokens.revoke(layout, "laptop", "test") == []
    assert door.find(second.value) is None
    assert door.valid() == frozenset()


def test_value_is_private_and_only_its_digest_is_in_the_record(layout: Layout) -> None:
    before = os.umask(0)
    try:
        value = made(layout, "laptop")
    finally:
        os.umask(before)
    path = tokens.path_of(layout, "laptop")
    assert path.read_text() == value + "\n"
    assert value.startswith("octoform_")
    assert len(value) > 48
    for private, mode in (
        (path, 0o600),
        (layout.run / "tokens.json", 0o600),
        (path.parent, 0o700),
        (layout.run, 0o700),
    ):
        assert stat.S_IMODE(private.stat().st_mode) == mode, private
    assert value not in (layout.run / "tokens.json").read_text()
    tokens.revoke(layout, "laptop", "test")
    assert not path.exists()


def test_token_ends_by_itself(layout: Layout) -> None:
    value = made(layout, "guest", seconds=60)
    now = [0.0]
    door = Tokens(layout.run / "tokens.json", now=lambda: now[0])
    found = door.find(value)
    assert found is not None
    assert found.end is not None
    now[0] = found.end - 0.001
    assert door.find(value) == found
    now[0] = found.end
    assert (door.find(value), door.valid()) == (None, frozenset())


def test_ended_token_is_listed_and_cannot_be_rotated(layout: Layout) -> None:
    made(layout, "guest", seconds=-1)
    listed, _ = tokens.listed(layout)
    assert [(token.name, token.ended) for token in listed] == [("guest", True)]
    _, problems = tokens.rotate(layout, "guest", "test")
    assert [item.code for item in problems] == ["TOKEN-ENDED"]


def records(layout: Layout) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (layout.logs / "audit.jsonl").read_text().splitlines()]


def test_each_change_is_on_the_audit_log_without_the_value(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    layout = Layout(project, "bench")
    assert octoform(project, "token", "create", "laptop", "-effects", "read,actuate") == 0
    first, _ = tokens.value_of(layout, "laptop")
    assert octoform(project, "token", "rotate", "laptop") == 0
    second, _ = tokens.value_of(layout, "laptop")
    assert octoform(project, "token", "revoke", "laptop") == 0
    assert octoform(project, "token", "revoke", "laptop") == 1
    lines = [(each["event"], each["token"], each["effects"]) for each in records(layout)]
    effects = ["read", "actuate"]
    assert lines == [(f"token_{what}", "laptop", effects) for what in ("created", "rotated", "revoked")]
    assert {each["by"] for each in records(layout)} == {person()}
    text = (layout.logs / "audit.jsonl").read_text()
    assert first and second and first not in text and second not in text
    capsys.readouterr()
    assert octoform(project, "audit") == 0
    assert f"the token laptop (read, actuate) got a new value by {person()}" in " ".join(
        capsys.readouterr().out.split()
    )
    assert octoform(project, "audit", "-verify") == 0


def test_nothing_is_opened_without_a_record_and_everything_closed(layout: Layout) -> None:
    value = made(layout, "laptop")
    layout.logs.rename(layout.logs.with_name("former"))
    layout.logs.touch()  # as unwritable as a full disk
    found, problems = tokens.create(layout, "other", ("read",), None, "test")
    assert (found, [item.code for item in problems]) == (None, ["TOKEN-NOT-RECORDED"])
    found, problems = tokens.rotate(layout, "laptop", "test")
    assert (found, [item.code for item in problems]) == (None, ["TOKEN-NOT-RECORDED"])
    assert served(layout).find(value) is not None
    [problem] = tokens.revoke(layout, "laptop", "test")
    assert (problem.code, problem.severity) == ("TOKEN-NOT-RECORDED", Severity.WARNING)
    assert served(layout).valid() == frozenset()


def test_first_token_is_made_once(layout: Layout) -> None:
    assert tokens.ensure_default(layout) == []
    value, _ = tokens.value_of(layout, "default")
    assert tokens.ensure_default(layout) == []
    assert tokens.value_of(layout, "default") == (value, [])
    assert value is not None
    found = served(layout).find(value)
    assert found is not None
    assert set(found.effects) == {"read", "actuate", "irreversible"}
    tokens.revoke(layout, "default", "test")
    tokens.ensure_default(layout)
    assert tokens.listed(layout) == ((), [])


@pytest.mark.parametrize("name", ["", ".", "..", "../x", "a/b", "-x", ".x", "a b", "a\n", "ä", "x" * 65, "a\x00"])
def test_name_is_plain(layout: Layout, name: str) -> None:
    found, problems = tokens.create(layout, name, ("read",), None)
    assert found is None
    assert [item.code for item in problems] == ["TOKEN-BAD-NAME"]
    assert not (layout.run / "tokens.json").exists()


@pytest.mark.parametrize(
    ("effects", "hint"), [(("raed",), "did you mean 'read'?"), ((), "effects are"), (("",), "effects")]
)
def test_effects_are_known(layout: Layout, effects: Sequence[str], hint: str) -> None:
    found, problems = tokens.create(layout, "laptop", effects, None)
    assert found is None
    assert [item.code for item in problems] == ["TOKEN-BAD-EFFECT"]
    assert hint in str(problems[0].hint)


def test_token_that_is_there_is_not_made_again(layout: Layout) -> None:
    value = made(layout, "laptop")
    _, problems = tokens.create(layout, "laptop", ("read",), None)
    assert [item.code for item in problems] == ["TOKEN-EXISTS"]
    assert served(layout).find(value) is not None


ENTRY = {"name": "a", "sha256": "00" * 32, "effects": ["read"], "created": "", "expires": None}
DAMAGED = [
    "{",
    "[]",
    "null",
    "[" * 200_000,
    '{"format": 2, "tokens": []}',
    '{"format": 1}',
    '{"format": 1, "tokens": {}, "x": 1}',
    '{"format": 1, "tokens": ["a"]}',
    *(
        json.dumps({"format": 1, "tokens": [entry]})
        for entry in (
            {"name": "a"},
            ENTRY | {"sha256": "zz"},
            ENTRY | {"effects": "read"},
            ENTRY | {"expires": "soon"},
            ENTRY | {"expires": "2036-01-01T00:00:00"},
            ENTRY | {"expires": 20360101},
        )
    ),
]


def test_entry_of_these_cases_is_good_but_for_what_each_spoils(layout: Layout) -> None:
    made(layout, "laptop")
    (layout.run / "tokens.json").write_text(json.dumps({"format": 1, "tokens": [ENTRY]}))
    assert [token.name for token in tokens.listed(layout)[0]] == ["a"]


@pytest.mark.parametrize("text", DAMAGED, ids=lambda text: text[:120])
def test_damaged_record_lets_nobody_in_and_says_so_once(
    layout: Layout, text: str, capfd: pytest.CaptureFixture[str]
) -> None:
    value = made(layout, "laptop")
    door = served(layout)
    assert door.find(value) is not None
    (layout.run / "tokens.json").write_text(text)
    assert [door.find(value) for _ in range(5)] == [None] * 5
    assert capfd.readouterr().err.count("no one gets in") == 1
    _, problems = tokens.listed(layout)
    assert [item.code for item in problems] == ["TOKEN-FILE"], "the person reads what the door reads"


def test_complaint_that_finds_no_room_lets_nobody_in_and_breaks_nothing(
    layout: Layout, monkeypatch: pytest.MonkeyPatch
) -> None:
    value = made(layout, "laptop")
    door = served(layout)
    (layout.run / "tokens.json").write_text("{")
    with Path("/dev/full").open("w", buffering=1) as full:
        monkeypatch.setattr("sys.stderr", full)
        assert door.find(value) is None
        monkeypatch.undo()
        with contextlib.suppress(OSError):
            full.close()


def test_link_in_the_place_of_the_record_is_told_as_one(layout: Layout) -> None:
    made(layout, "laptop")
    (layout.run / "tokens.json").rename(layout.run / "elsewhere")
    (layout.run / "tokens.json").symlink_to(layout.run / "elsewhere")
    _, (problem,) = tokens.listed(layout)
    assert (problem.code, problem.detail) == ("TOKEN-FILE", "it is a symlink")


def test_damaged_record_is_not_overwritten(layout: Layout) -> None:
    made(layout, "laptop")
    (layout.run / "tokens.json").write_text("{")
    for _, problems in (
        tokens.create(layout, "other", ("read",), None),
        tokens.rotate(layout, "laptop", "test"),
        tokens.value_of(layout, "laptop"),
        tokens.listed(layout),
        (None, tokens.revoke(layout, "laptop", "test")),
    ):
        assert [item.code for item in problems] == ["TOKEN-FILE"]
    assert (layout.run / "tokens.json").read_text() == "{"


def test_lost_value_is_told(layout: Layout) -> None:
    made(layout, "laptop")
    tokens.path_of(layout, "laptop").unlink()
    _, problems = tokens.value_of(layout, "laptop")
    assert [item.code for item in problems] == ["TOKEN-VALUE-GONE"]


@pytest.mark.parametrize("spoils", [b"octoform_\xc7abc", b"", b"octoform_another"])
def test_value_that_opens_nothing_is_not_shown(layout: Layout, spoils: bytes) -> None:
    made(layout, "laptop")
    made(layout, "phone")
    tokens.path_of(layout, "laptop").write_bytes(spoils)
    value, problems = tokens.value_of(layout, "laptop")
    assert value is None and [item.code for item in problems] == ["TOKEN-VALUE-GONE"]
    assert "codec" not in str(problems[0].detail) and "rotate laptop" in str(problems[0].hint)
    assert tokens.value_of(layout, "phone")[0] == tokens.kept_values(layout)["phone"]


def test_changes_at_once_lose_none(layout: Layout) -> None:
    threads = [threading.Thread(target=made, args=(layout, f"t{number}")) for number in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(tokens.listed(layout)[0]) == 12


def test_commands(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert octoform(project, "token", "list") == 0
    assert "no one gets in" in capsys.readouterr().out
    assert octoform(project, "token", "create", "laptop", "-effects", "read,actuate", "-expires", "24h", "-json") == 0
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    value = document["value"]
    assert (document["name"], document["effects"]) == ("laptop", ["read", "actuate"])
    assert octoform(project, "token", "show", "laptop") == 0
    assert capsys.readouterr().out == value + "\n"
    for words in (["token", "list"], ["token", "list", "-json"]):
        assert octoform(project, *words) == 0
        shown = capsys.readouterr().out
        assert "laptop" in shown
        assert value not in shown
    assert octoform(project, "token", "rotate", "laptop") == 0
    assert value not in capsys.readouterr().out
    assert octoform(project, "token", "revoke", "laptop") == 0
    assert octoform(project, "token", "show", "laptop") == 1
    assert "TOKEN-UNKNOWN" in capsys.readouterr().err


def test_token_may_only_read_unless_more_is_said(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert octoform(project, "token", "create", "laptop") == 0
    out = capsys.readouterr().out
    assert "it may call read." in out
    listed, _ = tokens.listed(Layout(project, "bench"))
    assert listed[0].effects == ("read",)
    assert octoform(project, "token", "create", "other", "-expires", "1d") == 1
