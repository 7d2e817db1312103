"""The core knows no device: no id literals, no device library, no platform branch outside the embedded agent."""

import ast
import functools
import re
from dataclasses import dataclass
from pathlib import Path

from architecture.parsed import nodes

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "octoform").rglob("*.py"))
# What lies below endpoint/scripts runs in the serving environment, beside the server's own libraries, and is imported
# by no module of the core; a picture that a tool gave is read there with whatever decoder the server has.
OUTSIDE = ("builtin", "runtime", "endpoint/scripts")
CORE = [path for path in FILES if not path.relative_to(ROOT / "octoform").as_posix().startswith(OUTSIDE)]
DEVICE_LIBRARIES = {"cv2", "serial", "smbus", "smbus2", "gpiod", "usb", "hid", "evdev", "sounddevice", "pyudev"}
# Where the daemon hears that something was plugged in or pulled; it opens nothing and asks for no device.
LISTENING = {"daemon/observe/hardware.py": {"pyudev"}}
USB_ID = re.compile(r"^[0-9a-fA-F]{4}:[0-9a-fA-F]{4}$")


@dataclass(frozen=True)
class Facts:
    """What the tests below ask of a module: its strings, the packages that it imports, the first words of its lists."""

    strings: tuple[str, ...]
    imported: frozenset[str]
    relative: frozenset[str]
    first_words: tuple[str, ...]


@functools.cache
def facts(path: Path) -> Facts:
    """Parsed once for all tests."""
    strings: list[str] = []
    imported: set[str] = set()
    relative: set[str] = set()
    words: list[str] = []
    for node in nodes(path.read_text()):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            strings.append(node.value)
        elif isinstance(node, ast.Import):
            imported |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            (relative if node.level else imported).add(node.module.split(".")[0])
        elif isinstance(node, ast.List | ast.Tuple) and node.elts:
            first = node.elts[0]
            words += [first.value] if isinstance(first, ast.Constant) and isinstance(first.value, str) else []
    return Facts(tuple(strings), frozenset(imported), frozenset(relative), tuple(words))


def test_no_usb_id_is_written_in_python() -> None:
    assert [(str(path), text) for path in FILES for text in facts(path).strings if USB_ID.match(text)] == []


def of_devices(path: Path) -> frozenset[str]:
    return (facts(path).imported | facts(path).relative) & DEVICE_LIBRARIES


def test_the_core_imports_no_device_library() -> None:
    used = {path.relative_to(ROOT / "octoform").as_posix(): of_devices(path) for path in CORE}
    assert {name: found for name, found in used.items() if found} == LISTENING


def test_the_shipped_package_names_no_package_registry_and_no_machine_path() -> None:
    suspicious = re.compile(r"//[\w.-]*\b(pypi|pythonhosted|npmjs)\b|/home/|/root/")
    found = [str(path.relative_to(ROOT)) for path in FILES if suspicious.search(path.read_text())]
    assert found == []


def calls_git(path: Path) -> bool:
    """Whether a module starts git by itself: a list or tuple that begins with its name, or a library that does it."""
    started = any(Path(word).name == "git" for word in facts(path).first_words)
    return bool(facts(path).imported & {"git", "pygit2", "dulwich"}) or started


def test_git_is_called_in_one_way_which_runs_no_program_of_the_repository() -> None:
    found = [path.relative_to(ROOT / "octoform").as_posix() for path in FILES if calls_git(path)]
    # A table of settings, a query and a list of programs name git as a word; none starts it.
    named = {"apply/protected_paths.py", "manifest/schema_errors.py", "state/model.py"}
    assert set(found) - named == {"state/git_access.py"}
