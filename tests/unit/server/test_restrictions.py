"""What claims restrict, as the endpoint reads it: released at its own moment, whichever process is dead."""

import enum
import json
import os
from pathlib import Path
from typing import Any

import pytest
from ledgers import ARM, Bench, Clock

from octoform.base.clock import boottime
from octoform.policy.published import Units
from octoform.server.restrictions import MAX_SECONDS, NAME, Restrictions, Subject

ENTRY: dict[str, Any] = {
    "claim": "c1",
    "tool": "move",
    "arguments": {"joint": ["elbow", "3"]},
    "effect": "deny",
    "target": "device:arm/elbow",
    "statement": "hot",
    "expires": 500.0,
    "expires_at": "2026-11-22T16:30:00Z",
}


class Watched:
    """The restrictions of a folder on a clock that only the test moves; ``heard`` are the audit's words."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / NAME
        self.now = 100.0
        self.heard: list[tuple[str, str]] = []
        self.made = Restrictions(self.path, self._hear, lambda: self.now, "boot-1")

    def _hear(self, event: str, fields: Any) -> None:
        self.heard.append((event, str(fields.get("claim", fields.get("text")))))

    def write(self, *entries: dict[str, Any], **more: Any) -> None:
        temporary = self.path.with_suffix(".new")
        whole = {"format": 1, "boot": "boot-1", "restrictions": list(entries), **more}
        temporary.write_text(json.dumps(whole))
        temporary.replace(self.path)

    def refuses(self, tool: str = "move", **arguments: Any) -> bool:
        return self.made.against(Subject(tool, arguments)) is not None


@pytest.fixture
def watched(tmp_path: Path) -> Watched:
    return Watched(tmp_path)


class Joint(enum.Enum):
    ELBOW = "elbow"


def test_without_a_file_nothing_is_restricted(watched: Watched) -> None:
    assert not watched.refuses(joint="elbow") and watched.made.shown() == {"in_force": [], "problem": None}
    assert Restrictions().in_force() == () and watched.heard == []


def test_calls_with_these_arguments_are_restricted_and_others_are_not(watched: Watched) -> None:
    watched.write(ENTRY)
    for joint in ("elbow", "3", Joint.ELBOW, ["wrist", "elbow"], {"elbow": 5, "wrist": 6}):
        assert watched.refuses(joint=joint), joint
    for other in ("wrist", 3, None, True, ["wrist"], {"wrist": "elbow"}):
        assert not watched.refuses(joint=other), other
    assert not watched.refuses() and not watched.refuses("look", joint="elbow")
    watched.write({**ENTRY, "arguments": {}})
    assert watched.refuses() and watched.refuses(joint="wrist")
    watched.write({**ENTRY, "arguments": {"on": [True]}})
    assert watched.refuses(on=True) and not watched.refuses(on=1) and not watched.refuses(on=False)


def test_denying_comes_before_asking(watched: Watched) -> None:
    watched.write({**ENTRY, "effect": "confirm", "claim": "c0"}, ENTRY)
    found = watched.made.against(Subject("move", {"joint": "elbow"}))
    assert found is not None and (found.effect, found.claim) == ("deny", "c1")


def test_each_is_let_go_at_its_own_moment_though_nobody_writes(watched: Watched) -> None:
    watched.write(ENTRY, {**ENTRY, "tool": "home", "claim": "c2", "arguments": {}, "expires": 700.0})
    assert watched.refuses(joint="elbow") and watched.refuses("home")
    watched.now = 499.9
    assert watched.refuses(joint="elbow")
    watched.now = 500.0
    assert not watched.refuses(joint="elbow") and watched.refuses("home")
    watched.now = 1e9
    assert watched.made.in_force() == ()
    assert watched.heard == [
        ("restriction", "c1"),
        ("restriction", "c2"),
        ("restriction_over", "c1"),
        ("restriction_over", "c2"),
    ]


def test_one_whose_end_is_put_off_is_no_news(watched: Watched) -> None:
    watched.write(ENTRY)
    assert watched.refuses(joint="elbow")
    watched.write({**ENTRY, "expires": 900.0})
    watched.now = 600.0
    assert watched.refuses(joint="elbow") and watched.heard == [("restriction", "c1")]
    watched.write()
    assert not watched.refuses(joint="elbow") and watched.heard[-1] == ("restriction_over", "c1")


def test_what_was_written_in_another_start_of_the_machine_is_over_but_for_a_persons_word(watched: Watched) -> None:
    watched.write(ENTRY, {**ENTRY, "expires": None, "tool": "home"}, boot="boot-0")
    assert not watched.refuses(joint="elbow") and watched.refuses("home", joint="elbow")
    watched.now = 1e9
    found = watched.made.against(Subject("home", {"joint": "elbow"}))
    assert found is not None and "A person ends it" in found.words


def test_an_end_that_lies_too_far_ahead_is_not_believed(watched: Watched) -> None:
    watched.write({**ENTRY, "expires": 100.0 + MAX_SECONDS + 1})
    assert not watched.refuses(joint="elbow")


BROKEN = {
    "empty": b"",
    "cut": b'{"format": 1, "boot": "boot-1", "restrictions": [',
    "newer": json.dumps({"format": 2, "boot": "boot-1", "restrictions": [ENTRY]}).encode(),
    "foreign": b'["something else"]',
    "bytes": b"\xff\xfe",
    "deep": b"[" * 50_000,
    "effect": json.dumps({"format": 1, "boot": "boot-1", "restrictions": [{**ENTRY, "effect": "destroy"}]}).encode(),
    "end": json.dumps({"format": 1, "boot": "boot-1", "restrictions": [{**ENTRY, "expires": "never"}]}).encode(),
    "no value": json.dumps({"format": 1, "boot": "b", "restrictions": [{**ENTRY, "arguments": {"a": []}}]}).encode(),
    "large": b" " * (4 * 1024 * 1024 + 1),
}


@pytest.mark.parametrize("how", BROKEN)
def test_a_file_that_cannot_be_read_restricts_nothing_and_is_said(
    watched: Watched, how: str, capsys: pytest.CaptureFixture[str]
) -> None:
    watched.write(ENTRY)
    assert watched.refuses(joint="elbow")
    watched.path.with_suffix(".new").write_bytes(BROKEN[how])
    watched.path.with_suffix(".new").replace(watched.path)
    assert not watched.refuses(joint="elbow") and not watched.refuses(joint="elbow")
    problem = watched.made.shown()["problem"]
    assert problem is not None and "nothing is restricted" in problem
    assert capsys.readouterr().err.count("nothing is restricted") == 1
    assert [event for event, _ in watched.heard] == ["restriction", "restrictions_unreadable", "restriction_over"]
    watched.write(ENTRY)
    assert watched.refuses(joint="elbow") and watched.made.problem is None


def test_a_link_or_a_pipe_is_not_followed_and_not_waited_for(watched: Watched) -> None:
    elsewhere = watched.path.with_name("elsewhere")
    watched.write(ENTRY)
    watched.path.rename(elsewhere)
    watched.path.symlink_to(elsewhere)
    assert not watched.refuses(joint="elbow") and watched.made.problem is not None
    watched.path.unlink()
    os.mkfifo(watched.path)
    assert not watched.refuses(joint="elbow") and watched.made.problem is not None
    watched.path.unlink()
    assert not watched.refuses(joint="elbow") and watched.made.problem is None


def test_the_words_hold_what_an_agent_wrote_in_bounds(watched: Watched) -> None:
    watched.write({**ENTRY, "statement": "\x1b[2J\n" + "x" * 5000})
    found = watched.made.against(Subject("move", {"joint": "elbow"}))
    assert found is not None and found.words.isprintable() and len(found.words) < 600
    assert "joint elbow" in found.words and "2026-11-22T16:30:00Z" in found.words
    (shown,) = watched.made.shown()["in_force"]
    assert shown["seconds"] == 400.0 and len(shown["statement"]) == 200


def test_what_the_ledger_writes_is_what_counts_here_by_this_machines_own_clock(tmp_path: Path) -> None:
    clock = Clock(boottime())
    bench = Bench(tmp_path, clock, boot="")
    bench.claim(bench.read(70))
    made = Restrictions(bench.layout.restrictions)
    units = Units({"elbow_flex": ("3",), "gripper": ("6",)}, "joint")
    known = {ARM: {"elbow_flex", "3", "gripper", "6"}}

    def call(joint: str) -> Subject:
        return Subject("arm_move_joint", {"joint": joint}, (ARM,), units, known)

    assert made.against(call("elbow_flex")) is not None and made.against(call("3")) is not None
    assert made.against(call("gripper")) is None
    clock.now += 1
    bench.read(50)
    assert made.in_force() == () and made.problem is None


@pytest.mark.parametrize(("damage", "words"), [("pipe", "it is no regular file"), ("{}", "it "), ("[]", "it ")])
def test_a_damaged_file_is_reported_in_words_of_octoform(watched: Watched, damage: str, words: str) -> None:
    watched.write(ENTRY)
    assert watched.refuses(joint="elbow")
    watched.path.unlink()
    if damage == "pipe":
        os.mkfifo(watched.path)
    else:
        watched.path.write_text(damage)
    watched.refuses(joint="elbow")
    ((_, text),) = [item for item in watched.heard if "cannot be read" in item[1]]
    assert words in text and "Error" not in text and "Errno" not in text and "' object" not in text
