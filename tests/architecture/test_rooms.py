"""A stranger finds a module by its path: rooms of at most 16 modules, and names that are nouns of the field."""

from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2] / "octoform"
MODULES = [path.relative_to(ROOT) for path in sorted(ROOT.rglob("*.py")) if path.stem not in ("__init__", "__main__")]
MAX_MODULES = 16
# Folders that have no rooms yet; the list may only become shorter.
FLAT = {"runtime"}
# Packages whose modules do not have the names of the field yet.
UNNAMED: set[str] = set()
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


def test_no_folder_has_more_than_16_modules() -> None:
    counted = Counter(path.parent.as_posix() for path in MODULES)
    assert {folder for folder, count in counted.items() if count > MAX_MODULES} == FLAT


def test_modules_are_called_by_nouns() -> None:
    named = [path for path in MODULES if path.parts[0] not in UNNAMED]
    assert [path.as_posix() for path in named if path.stem.endswith("ing") and path.stem not in NOUNS] == []


def test_each_path_of_the_architecture_leads_somewhere() -> None:
    text = (ROOT.parent / "docs" / "architecture.md").read_text()
    rows = [line for line in text.partition("## Where a change goes")[2].splitlines() if line.startswith("| ")]
    paths = [word for line in rows for word in line.split("`")[1::2] if "/" in word and word == word.lower()]
    assert len(paths) > 20
    assert [path for path in paths if not (ROOT / path).exists()] == []
