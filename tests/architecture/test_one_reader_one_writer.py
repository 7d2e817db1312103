"""Files are read, written, replaced and renamed by `base/files.py` alone.

A pipe keeps a plain `open` waiting without end, a full disk leaves half of what `write_text` wrote, JSON of 900 levels
ends `json.loads` with a RecursionError, and a rename of an unsynced draft loses both files in a power cut. The base
handles each of them once.
"""

import ast
import re
from collections.abc import Iterator, Set
from pathlib import Path

import pytest
from architecture.parsed import nodes

ROOT = Path(__file__).parents[2] / "octoform"
FILES = [path for path in sorted(ROOT.rglob("*.py")) if not path.is_symlink()]
# Programs that run beside a server's own libraries, where octoform is not, and get their input from octoform; and the
# makers of simulated trees, which are given an empty folder.
ALONE = ("endpoint/scripts/", "simulation/")
# The base itself, and the parser of outputs, which reports line and column of what is wrong.
READERS = {"base/files.py", "contracts/artifact_parser.py"}
PLAIN = {"read_text", "read_bytes", "write_text", "write_bytes"}
# Calls that give a file another name, or put it in the place of another one.
RENAMES = {"os.replace", "os.rename", "os.renames", "os.link", "shutil.move"}
RENAMING = {"rename", "hardlink_to", "link_to"}
DRAFTS = {"NamedTemporaryFile", "mkstemp"}
# What renames and replaces no file: whole folders, which no rename replaces unless they are empty, a move that may
# cross file systems, and a further name for a file that keeps its own.
FOLDERS = {
    "apply/file_integrity.py": ["now.rename", "shutil.move"],
    "endpoint/environment/build.py": ["os.link"],
    "engine/recording.py": ["target.rename", "draft.rename", "former.rename"],
    "engine/unattended/repairs.py": ["place.rename", "aside.rename"],
    "harness/installer.py": ["staging.rename"],
    "state/artifact_cache.py": ["shutil.move"],
    "state/files.py": ["path.rename"],
}
MODE = re.compile(r"'[rwxa]b?\+?'")
# What keeps `os.open` from waiting for the other end of a pipe, or from taking what is there already.
PROMPT = {"O_NONBLOCK", "O_DIRECTORY", "O_EXCL", "O_RDWR", "/proc/", "PROC /", "{proc}/", "devnull"}


def relative(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def calls(source: str, names: Set[str]) -> Iterator[tuple[ast.Call, str, str]]:
    """Every call of one of the names, with the words before its last dot and the word after it."""
    for node in nodes(source):
        if not isinstance(node, ast.Call):
            continue
        if isinstance(node.func, ast.Attribute) and node.func.attr in names:
            yield node, ast.unparse(node.func.value), node.func.attr
        elif isinstance(node.func, ast.Name) and node.func.id in names:
            yield node, "", node.func.id


def shipped(owner: str) -> bool:
    """Whether a path is one of the package's own files or of the kernel's: a constant, or below /proc."""
    first = re.match(r"\(?([A-Za-z_]\w*)", owner)
    constant = first is not None and (first[1].isupper() or first[1] == "proc")
    return constant or owner.startswith(("Path('/proc/", "Path(f'/proc/", "resources."))


def is_plain(call: ast.Call, owner: str, name: str) -> bool:
    """A read or write by a path that waits for a pipe, follows a link or leaves half a file."""
    if name == "open":
        modes = [ast.unparse(word) for word in (*call.args[:2], *(each.value for each in call.keywords))]
        return owner not in {"os", "gzip"} and any(MODE.fullmatch(word) for word in modes)
    return name in PLAIN and bool(owner) and not shipped(owner)


def flags(source: str, call: ast.Call) -> str:
    """The flags of an `os.open`, with those of the names in them."""
    text = " ".join(ast.unparse(word) for word in call.args)
    assigned = [node for node in nodes(source) if isinstance(node, ast.Assign)]
    named = [node.value for node in assigned if any(ast.unparse(target) in text.split() for target in node.targets)]
    return " ".join((text, *map(ast.unparse, named)))


def waits(source: str) -> list[str]:
    """The calls that may wait for another process, or take what they should not."""
    found = list(calls(source, PLAIN | {"open"}))
    plain = [f"{call.lineno}: {owner}.{name}" for call, owner, name in found if is_plain(call, owner, name)]
    opened = [call for call, owner, name in found if (owner, name) == ("os", "open")]
    late = [call for call in opened if not any(word in flags(source, call) for word in PROMPT)]
    return [*plain, *(f"{call.lineno}: {ast.unparse(call)}" for call in late)]


def parses(source: str) -> list[int]:
    return [call.lineno for call, owner, _ in calls(source, {"load", "loads"}) if owner == "json"]


def is_rename(call: ast.Call, owner: str, name: str) -> bool:
    """Whether a call renames a file; ``replace`` with one argument is that of a path, with more that of a string."""
    alone = name == "replace" and bool(owner) and len(call.args) == 1 and not call.keywords
    return f"{owner}.{name}" in RENAMES or name in RENAMING | DRAFTS or (alone and owner not in {"dataclasses", "copy"})


def renames(source: str) -> list[str]:
    """The calls that may be a second way of replacing a file, by their line."""
    named = calls(source, RENAMING | DRAFTS | {name.rpartition(".")[2] for name in RENAMES})
    found = sorted((call.lineno, f"{owner}.{name}") for call, owner, name in named if is_rename(call, owner, name))
    return [text for _, text in found]


def is_program(path: Path) -> bool:
    """A program that is started by its file: no package is on its path, so that it imports nothing of octoform."""
    text = path.read_text()
    return '__name__ == "__main__"' in text and not re.search(r"^(from|import) (octoform|\.)", text, re.MULTILINE)


WATCHED = [
    path for path in FILES if not (relative(path).startswith(ALONE) or relative(path) in READERS or is_program(path))
]


def test_json_is_parsed_and_files_are_read_and_written_by_the_base() -> None:
    found = {}
    for path in WATCHED:
        source = path.read_text()
        # The runtime is the one part that opens nodes: what it reads there is the device.
        found[relative(path)] = (parses(source), [] if relative(path).startswith("runtime/") else waits(source))
    assert {name: both for name, both in found.items() if both != ([], [])} == {}


def test_files_are_replaced_and_renamed_by_the_base_alone() -> None:
    # The runtime and the programs beside a server replace nothing: they are read too.
    found = {relative(path): renames(path.read_text()) for path in FILES}
    base = found.pop("base/files.py")
    assert base
    assert {name: lines for name, lines in found.items() if lines} == FOLDERS


@pytest.mark.parametrize(
    "line",
    [
        "os.replace(draft, path)",
        "os.rename(a, b, src_dir_fd=f, dst_dir_fd=f)",
        "os.link(draft, path)",
        "draft.replace(path)",
        "(draft / '1').replace(folder / name)",
        "path.rename(kept)",
        "tempfile.NamedTemporaryFile(dir=folder)",
        "shutil.move(path, copy)",
    ],
)
def test_the_rule_sees_a_second_way_of_replacing(line: str) -> None:
    assert renames(line)


@pytest.mark.parametrize(
    "line",
    [
        "text.replace('a', 'b')",
        "moment.replace(microsecond=0)",
        "replace(path, data)",
        "dataclasses.replace(found, path=path)",
        "files.replace(path, data, 0o644)",
    ],
)
def test_the_rule_lets_pass_what_replaces_no_file_by_itself(line: str) -> None:
    assert not renames(line)


@pytest.mark.parametrize(
    "line",
    [
        "path.read_text()",
        "(folder / 'a.json').read_bytes()",
        "path.write_text('a')",
        "path.open('rb')",
        "open(path, 'w')",
        "os.open(path, os.O_RDONLY | os.O_CLOEXEC)",
        "how = os.O_WRONLY | os.O_APPEND\nos.open(path, how)",
    ],
)
def test_the_rule_sees_what_it_forbids(line: str) -> None:
    assert waits(line)


@pytest.mark.parametrize(
    "line",
    [
        "SHIPPED.read_bytes()",
        "Path('/proc/self/stat').read_text()",
        "StateStore.open(layout)",
        "read_text(path)",
        "os.open(path, os.O_RDONLY | os.O_NONBLOCK)",
        "how = os.O_RDWR | os.O_CREAT\nos.open(path, how)",
    ],
)
def test_the_rule_lets_pass_what_waits_for_nobody(line: str) -> None:
    assert not waits(line)
