"""Reading profiles: what one must have, and that none is code."""

import textwrap
from pathlib import Path

import pytest

from octoform.profiles import Profile, load
from octoform.profiles.model import Stop

PAGES = Path(__file__).parents[3] / "octoform" / "diagnostics" / "pages"
GOOD = """---
name: bench-lamp
about: the lamp over the bench
evidence: {all: [{vid_pid: "16c0:05df"}, {text: [Bench Lamp]}]}
limits:
  - {tool: set_lamp, parameter: percent, maximum: 80, unit: "%"}
---

It must not get hot.
"""


@pytest.fixture
def read(tmp_path: Path) -> object:
    def one(text: str, name: str = "lamp.md") -> tuple[tuple[Profile, ...], list[str]]:
        (tmp_path / name).write_text(text)
        profiles, found = load([tmp_path / name])
        for item in found:
            assert (PAGES / f"{item.code}.md").read_text().startswith(f"# {item.code}: ")
        return profiles, [item.code for item in found]

    return one


def test_a_good_profile(tmp_path: Path) -> None:
    path = tmp_path / "lamp.md"
    path.write_text(GOOD)
    (profile,), found = load([path])
    assert found == []
    assert (profile.name, profile.about, profile.body) == (
        "bench-lamp",
        "the lamp over the bench",
        "It must not get hot.\n",
    )
    assert profile.limits == ({"tool": "set_lamp", "parameter": "percent", "maximum": 80, "unit": "%"},)
    path.write_bytes(GOOD.replace("\n", "\r\n").encode())
    assert load([path])[0][0].digest == profile.digest
    path.write_text(GOOD.replace("hot", "wet"))
    assert load([path])[0][0].digest != profile.digest


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("name: bench-lamp\n", "", "PROFILE-FIELD"),
        ("name: bench-lamp", "name: Bench Lamp", "PROFILE-FIELD"),
        ("about: the lamp over the bench\n", "", "PROFILE-FIELD"),
        ("limits:", "limit:", "PROFILE-FIELD"),
        ("It must not get hot.", "", "PROFILE-FIELD"),
        ("evidence:", "evidenz:", "PROFILE-EVIDENCE"),
        ("text: [Bench Lamp]", "regex: '.*'", "PROFILE-EVIDENCE"),
        ('"16c0:05df"', "16", "PROFILE-EVIDENCE"),
        ("maximum: 80", "maximum: eighty", "PROFILE-LIMIT"),
        ("maximum: 80", "maximum: .nan", "PROFILE-LIMIT"),
        ("maximum: 80", "maximum: true", "PROFILE-LIMIT"),
        ("maximum: 80", "minimum: 81, maximum: 80", "PROFILE-LIMIT"),
        ("maximum: 80, ", "", "PROFILE-LIMIT"),
        ("parameter: percent, ", "", "PROFILE-LIMIT"),
        ("unit:", "units:", "PROFILE-FIELD"),
        ("maximum: 80", "step: 0", "PROFILE-LIMIT"),
        ("maximum: 80", "step: -5", "PROFILE-LIMIT"),
        ("maximum: 80", "cumulative: a lot", "PROFILE-LIMIT"),
        ("maximum: 80", "cumulative: .inf", "PROFILE-LIMIT"),
        ("maximum: 80", "maximum: .inf", "PROFILE-LIMIT"),
        ("parameter: percent, maximum: 80", "step: 5", "PROFILE-LIMIT"),
        ("parameter: percent, maximum: 80", "rate: 10/x", "PROFILE-LIMIT"),
        ("parameter: percent, maximum: 80", "rate: 10", "PROFILE-LIMIT"),
        ("parameter: percent, maximum: 80", "cooldown: 2", "PROFILE-LIMIT"),
        ("parameter: percent, maximum: 80", "cooldown: 25h", "PROFILE-LIMIT"),
        ("parameter: percent, maximum: 80", "quiet_hours: 22:00", "PROFILE-LIMIT"),
        ("parameter: percent, maximum: 80", "quiet_hours: [22:00-07:00]", "PROFILE-LIMIT"),
        ("maximum: 80", "rate: 10/1m", "PROFILE-LIMIT"),
        ("tool: set_lamp, parameter: percent, maximum: 80", "rate: 10/1m", "PROFILE-LIMIT"),
        ("maximum: 80", "rates: 10/1m, maximum: 80", "PROFILE-FIELD"),
        ("limits:\n", "stop: {class: tty}\nlimits:\n", "PROFILE-STOP"),
        ("limits:\n", "stop: [tty]\nlimits:\n", "PROFILE-STOP"),
        ("limits:\n", 'stop: [{class: tty, write: ""}]\nlimits:\n', "PROFILE-STOP"),
        ("limits:\n", "stop: [{class: tty, write: FG}]\nlimits:\n", "PROFILE-STOP"),
        ("limits:\n", "stop: [{class: tty, write: 12}]\nlimits:\n", "PROFILE-STOP"),
        ("limits:\n", f'stop: [{{class: tty, write: "{"00" * 257}"}}]\nlimits:\n', "PROFILE-STOP"),
        ("limits:\n", "stop: [{write: FF}]\nlimits:\n", "PROFILE-STOP"),
        ("limits:\n", "stop: [{class: ../tty, write: FF}]\nlimits:\n", "PROFILE-STOP"),
        ("limits:\n", "stop: [{class: tty, baud: 0, write: FF}]\nlimits:\n", "PROFILE-STOP"),
        ("limits:\n", "stop: [{class: tty, baud: 9600.5, write: FF}]\nlimits:\n", "PROFILE-STOP"),
        ("limits:\n", "stop: [{class: tty, baud: true, write: FF}]\nlimits:\n", "PROFILE-STOP"),
        ("limits:\n", "stop: [{class: tty, write: FF, run: reboot}]\nlimits:\n", "PROFILE-STOP"),
        ("limits:\n", f"stop: [{'{class: tty, write: FF},' * 21}]\nlimits:\n", "PROFILE-STOP"),
        ("It must", "```python\nimport os\n```\nIt must", "PROFILE-CODE"),
        ("It must", "~~~ sh\nreboot\n~~~\nIt must", "PROFILE-CODE"),
        ("It must", "x" * 12300, "PROFILE-TOO-LARGE"),
        ("---\n\nIt", "It", "PROFILE-FRONT-MATTER"),
    ],
)
def test_a_profile_with_a_fault_is_left_out(read, old: str, new: str, code: str) -> None:  # type: ignore[no-untyped-def]
    assert old in GOOD
    profiles, codes = read(GOOD.replace(old, new, 1))
    assert profiles == ()
    assert code in codes


def test_limits_of_calls_and_stop_actions(tmp_path: Path) -> None:
    path = tmp_path / "lamp.md"
    more = (
        "  - {parameter: percent, step: 5, cumulative: 500.5}\n"
        "  - {tool: 'set_*', rate: 10/1m}\n"
        "  - {tool: set_lamp, cooldown: 2s, quiet_hours: 22:00-07:00}\n"
        "stop:\n"
        "  - {class: tty, baud: 1000000, write: FF FF fe 00}\n"
        "  - {class: hidraw, write: '00'}\n"
        "---\n\nIt"
    )
    path.write_text(GOOD.replace("---\n\nIt", more))
    (profile,), found = load([path])
    assert found == []
    assert profile.limits[1:] == (
        {"parameter": "percent", "step": 5, "cumulative": 500.5},
        {"tool": "set_*", "rate": "10/1m"},
        {"tool": "set_lamp", "cooldown": "2s", "quiet_hours": "22:00-07:00"},
    )
    assert profile.stop == (Stop("tty", 1_000_000, b"\xff\xff\xfe\x00"), Stop("hidraw", None, b"\x00"))


def test_the_documented_profile_is_one(tmp_path: Path) -> None:
    text = (PAGES.parents[2] / "docs" / "profiles.md").read_text()
    lines = [line for line in text.split("## Evidence")[0].splitlines() if line.startswith("    ") or not line]
    stop = [
        line for line in text.split("## Emergency stop")[1].split("\n## ")[0].splitlines() if line.startswith("    ")
    ]
    profile = textwrap.dedent("\n".join(lines)).strip()
    path = tmp_path / "lamp.md"
    path.write_text(profile.replace("---\n\n", "\n".join([*(line[4:] for line in stop), "---", "", ""]), 1))
    (read,), found = load([path])
    assert found == []
    assert (read.name, len(read.limits), read.stop) == ("bench-lamp", 1, (Stop("tty", 115200, b"\x01\x02\x0a"),))


def test_a_limit_with_a_fault_says_where_and_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "lamp.md"
    path.write_text(GOOD.replace("maximum: 80", "rate: 10/1m"))
    (problem,) = load([path])[1]
    assert (problem.summary, problem.span.line if problem.span else None) == (
        "nothing in the limit speaks of its parameter",
        6,
    )
    assert problem.hint == "remove it, or give one of minimum, maximum, step, cumulative"


@pytest.mark.parametrize("name", ["lamp.py", "lamp.sh", "lamp", "lamp.md.py"])
def test_a_code_file_is_refused_unread(read, name: str) -> None:  # type: ignore[no-untyped-def]
    assert read(GOOD, name) == ((), ["PROFILE-CODE"])


def test_an_executable_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "lamp.md"
    path.write_text(GOOD)
    path.chmod(0o755)
    assert [item.code for item in load([path])[1]] == ["PROFILE-CODE"]


def test_plain_blocks_are_welcome(read) -> None:  # type: ignore[no-untyped-def]
    profiles, codes = read(GOOD + "\n```\nMOVE_X N\n```\n\n```text\nreply: OK\n```\n")
    assert len(profiles) == 1 and codes == []


def test_a_rule_on_numbers_alone_is_a_warning(read) -> None:  # type: ignore[no-untyped-def]
    profiles, codes = read(GOOD.replace(", {text: [Bench Lamp]}", ""))
    assert len(profiles) == 1
    assert codes == ["PROFILE-WEAK-EVIDENCE"]


def test_one_name_is_for_one_profile(tmp_path: Path) -> None:
    for name in ("a.md", "b.md"):
        (tmp_path / name).write_text(GOOD)
    profiles, found = load([tmp_path / "a.md", tmp_path / "b.md", tmp_path / "absent.md"])
    assert [profile.path.name for profile in profiles] == ["a.md"]
    assert [item.code for item in found] == ["PROFILE-DUPLICATE-NAME", "PROFILE-FRONT-MATTER"]
