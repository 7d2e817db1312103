"""Reading profiles: what one must have, and that none is code."""

from pathlib import Path

import pytest

from octoform.profiles import Profile, load

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
        ("It must", "```python\nimport os\n```\nIt must", "PROFILE-CODE"),
        ("It must", "~~~ sh\nreboot\n~~~\nIt must", "PROFILE-CODE"),
        ("It must", "x" * 9000, "PROFILE-TOO-LARGE"),
        ("---\n\nIt", "It", "PROFILE-FRONT-MATTER"),
    ],
)
def test_a_profile_with_a_fault_is_left_out(read, old: str, new: str, code: str) -> None:  # type: ignore[no-untyped-def]
    assert old in GOOD
    profiles, codes = read(GOOD.replace(old, new, 1))
    assert profiles == ()
    assert code in codes


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
