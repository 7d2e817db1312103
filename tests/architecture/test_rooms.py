"""A stranger finds a module by its path: rooms of at most 16 modules, and names that are nouns of the field."""

from collections import Counter, defaultdict
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[2] / "octoform"
MODULES = [path.relative_to(ROOT) for path in sorted(ROOT.rglob("*.py")) if path.stem not in ("__init__", "__main__")]
MAX_MODULES = 16
# Words that end as a gerund and are the field's own nouns.
NOUNS = {
    "binding",
    "by_reading",
    "counting",
    "device_binding",
    "escaping",
    "polling",
    "recording",
    "reporting",
    "spelling",
    "wiring",
}

# A package's own values and the start of a program are called alike everywhere.
ROLES = {"main", "model"}
# What composes and what shows a thing is called as the thing: one noun at different heights.
HEIGHTS = {"cli", "engine", "views"}
# One thing in several packages (decision 0006 has the reasons): any other name that two packages share is a new
# meaning.
SAME = {
    "audit_log": {"endpoint", "server"},
    "files": {"base", "state"},
    "heal": {"apply", "builtin", "engine"},
    "instance_lock": {"daemon", "server"},
    "lines": {"builtin", "profiles", "runtime"},
    "registers": {"builtin", "profiles", "runtime"},
    "sysfs": {"builtin", "runtime"},
    "tokens": {"base", "endpoint"},
    "watch": {"apply", "builtin"},
}
# Suites below tests/unit that are of no package: a part of one, or of several.
SUITES = {"hostile", "recordings", "support"}


def shared(modules: Iterable[tuple[str, str]]) -> dict[str, set[str]]:
    """The names of modules that several packages have, but for roles and for one noun at different heights."""
    found: dict[str, set[str]] = defaultdict(set)
    for package, name in modules:
        found[name].add(package)
    return {
        name: held for name, held in found.items() if name not in ROLES and len(held) > 1 and len(held - HEIGHTS) > 1
    }


def test_a_module_name_means_one_thing() -> None:
    named = {(path.parts[0], path.stem) for path in MODULES if len(path.parts) > 1 and not (ROOT / path).is_symlink()}
    found = shared(named)
    assert {name: held for name, held in found.items() if SAME.get(name) != held} == {}
    assert SAME.keys() - found.keys() == set(), "an exception that nothing needs any more"


def test_the_rule_sees_a_name_with_two_meanings() -> None:
    assert shared([("apply", "gate"), ("server", "gate"), ("server", "audit")]) == {"gate": {"apply", "server"}}
    assert shared([("engine", "plan"), ("views", "plan"), ("plan", "plan"), ("a", "model"), ("b", "model")]) == {}


def test_rooms_that_the_folders_of_tests_name_are_there() -> None:
    rooms = {path.relative_to(ROOT).parts[0] for path in ROOT.glob("*/**/*.py")}
    folders = {path.parent.name for path in (ROOT.parent / "tests" / "unit").glob("*/*.py")}
    modules = {path.stem for path in MODULES}
    unknown = {name for name in folders - rooms - SUITES - modules if name.partition("_")[0] not in rooms}
    assert unknown == set()


def test_no_folder_has_more_than_16_modules() -> None:
    counted = Counter(path.parent.as_posix() for path in MODULES)
    assert {folder: count for folder, count in counted.items() if count > MAX_MODULES} == {}


def test_modules_are_called_by_nouns() -> None:
    assert [path.as_posix() for path in MODULES if path.stem.endswith("ing") and path.stem not in NOUNS] == []


def test_each_path_of_the_architecture_leads_somewhere() -> None:
    text = (ROOT.parent / "docs" / "architecture.md").read_text()
    rows = [line for line in text.partition("## Where a change goes")[2].splitlines() if line.startswith("| ")]
    paths = [word for line in rows for word in line.split("`")[1::2] if "/" in word and word == word.lower()]
    assert len(paths) > 20
    assert [path for path in paths if not (ROOT / path).exists()] == []
