"""Some ideas have one place, in `base/`: a second copy drifts from the first, and the drift is an unseen bug."""

import ast
import functools
import re
import tomllib
from collections import Counter
from pathlib import Path

from architecture import parsed
from cases import for_each
from packaging.requirements import Requirement

TOP = Path(__file__).parents[2]
ROOT = TOP / "octoform"
FILES = [path for path in sorted(ROOT.rglob("*.py")) if not path.is_symlink()]
# What gives an idea away in the source, and the module that holds it.
IDEAS = {
    "the check of a record's format": (
        r"raise OtherFormatError|\['format'\] (?:[<>=!]=|<|>) [F\d]|\.get\('format'\) [=!]= [F\d]",
        "base/files.py",
    ),
    "a private folder": (
        r"def private_folder|mkdir\((?=[^)]*mode=448)(?=[^)]*parents=True)",
        "base/files.py",
    ),
    "a signal to another process": (r"\bos\.kill(?:pg)?\(|pidfd_send_signal\(", "base/processes.py"),
    "the command line of a process": (r"'cmdline'|/cmdline", "base/processes.py"),
    "a moment as text": (r"%Y-%m-%dT|\.isoformat\(|datetime\.fromisoformat\(", "base/clock.py"),
    "the clock that goes on in sleep": (r"CLOCK_BOOTTIME", "base/clock.py"),
    "which start of the machine this is": (r"random/boot_id|'boot_id'\)\.read", "base/clock.py"),
    "a lock on a file": (r"\b(?:flock|lockf)\(", "base/locks.py"),
    "a token of a JSON pointer": (r"'~0'", "base/shape.py"),
    "the escape of a character": (r"\\\\[xuU]\{", "base/escaping.py"),
    "what lies in a repository's own files": (r"'packed-refs'|/ 'commondir'|'gitdir: '|'ref: '", "state/git_access.py"),
    "the words for health": (r"'healthy'", "base/health_status.py"),
    "whether a record of health is of now": (r"<= \w+\['until'\]", "base/health_status.py"),
    "the key part of a consumed output": (r"'input\.'|f'input\.\{", "graph/model.py"),
    "the hash of a node's inputs in its state": (r"(?:'key': |\bkey=)\w*\.?key_of\(", "state/accepted.py"),
    "the way back from a stage": (r"'deploy': 'serve'\}|'deploy': \w+\('serve'", "graph/compile.py"),
    "a kind of limit": (r"'(?:cooldown|cumulative|quiet_hours)'", "policy/kinds.py"),
    "the line of a process in /proc": (r"r(?:index|find|partition)\(b?'\)'\)", "base/processes.py"),
}
COPIED = ("base", "policy", "runtime", "server")
SERVED = re.compile(r"\b(?:fastmcp|pydantic|opencv-python-headless|pyserial|typing-extensions)[<>=~][^\"']*")
"""A requirement of a package that generated servers import."""
# A source that has none of this, in whatever form it is written, has none of the ideas.
POSSIBLE = re.compile(
    r"OtherFormatError|['\"]format['\"]|private_folder|mkdir|kill|pidfd_send|cmdline|%Y|isoformat|CLOCK_BOOTTIME"
    r"|boot_id|['\"]deploy['\"]: |packed-refs|commondir|gitdir: |['\"]ref: |['\"]healthy|['\"]until"
    r"|cooldown|key_of|input\.|\bf?lockf?\b|~0|\\[xuU]\{|\)['\"]\)"
)


def is_program(text: str) -> bool:
    """A program that is started by its file, where no package is on its path: it imports nothing of octoform."""
    return "__name__ == '__main__'" in text and not re.search(r"^(?:from|import) (?:octoform|\.)", text, re.MULTILINE)


def holders(pattern: str, texts: dict[str, str]) -> list[str]:
    return [name for name, text in texts.items() if re.search(pattern, text) and not is_program(text)]


@functools.cache
def sources() -> dict[str, str]:
    """All that may have one of the ideas, unparsed once for all of them."""
    read = {path.relative_to(ROOT).as_posix(): path.read_text() for path in FILES}
    return {name: code(source) for name, source in read.items() if POSSIBLE.search(source)}


def code(source: str) -> str:
    """The source without docstrings and comments, as Python itself would write it."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if (
            isinstance(body, list)
            and body
            and isinstance(body[0], ast.Expr)
            and isinstance(body[0].value, ast.Constant)
        ):
            body[0] = ast.Pass()
    return ast.unparse(tree)


@for_each("idea", sorted(IDEAS))
def test_an_idea_of_the_base_has_no_second_copy(idea: str) -> None:
    pattern, home = IDEAS[idea]
    assert holders(pattern, sources()) == [home]


def test_a_second_copy_is_found() -> None:
    pattern, _ = IDEAS["a token of a JSON pointer"]
    first = "def step(part):\n    return part.replace('~', '~0')"
    assert POSSIBLE.search(first)
    program = f"{first}\nif __name__ == '__main__':\n    step()"
    assert holders(pattern, {"a.py": first, "b.py": first}) == ["a.py", "b.py"]
    assert holders(pattern, {"a.py": first, "b.py": program}) == ["a.py"]


def assigned_twice(source: str) -> list[str]:
    """The constants of a module that it assigns again, whose first value is so in force for no one who calls."""
    found = Counter(
        node.id
        for statement in parsed.tree(source).body
        if isinstance(statement, ast.Assign)
        for target in statement.targets
        for node in ast.walk(target)
        if isinstance(node, ast.Name) and node.id.isupper()
    )
    return [name for name, count in found.items() if count > 1]


def test_a_constant_is_assigned_once() -> None:
    twice = {path.relative_to(ROOT).as_posix(): assigned_twice(path.read_text()) for path in FILES}
    assert {name: names for name, names in twice.items() if names} == {}
    assert assigned_twice("LIMIT, SIZE = 20, 4\nOTHER = 1\nLIMIT = 40\n") == ["LIMIT"]


def compiled_at_import(source: str) -> list[int]:
    """The lines on which a module compiles a regular expression while it is imported."""
    nodes = parsed.nodes(source)
    later = {id(node) for each in nodes if isinstance(each, ast.FunctionDef) for node in ast.walk(each)}
    calls = [node for node in nodes if isinstance(node, ast.Call) and id(node) not in later]
    return [node.lineno for node in calls if ast.unparse(node.func) == "re.compile"]


def test_no_module_compiles_an_expression_at_its_import() -> None:
    # What is copied beside a server has no `octoform.patterns`, and few expressions.
    sources = {path: path.read_text() for path in FILES if path.relative_to(ROOT).parts[0] not in COPIED}
    found = {path.name: compiled_at_import(source) for path, source in sources.items() if "re.compile(" in source}
    assert {name: lines for name, lines in found.items() if lines} == {}
    assert compiled_at_import("A = re.compile('a')\ndef f():\n    re.compile('b')\nB = (re.compile('c'),)") == [1, 4]


def test_the_packages_that_the_owner_chose_are_named_where_they_are_needed() -> None:
    project = tomllib.loads((TOP / "pyproject.toml").read_text())["project"]
    places = {"": project["dependencies"], **project["optional-dependencies"]}
    named = {(place, Requirement(text).name.lower()) for place, texts in places.items() for text in texts}
    assert {("", name) for name in ("pydantic", "jsonschema", "ruamel.yaml", "jinja2", "gitpython")} <= named
    assert {("serving", name) for name in ("fastmcp", "pyserial", "opencv-python-headless")} <= named
    assert {("litellm", "litellm"), ("dev", "pytest")} <= named
    optional = {"litellm", "fastmcp", "pyserial", "opencv-python-headless"}
    elsewhere = {(place, name) for place, name in named if name in optional} - {(name, name) for name in optional}
    # The tests' client is a package of the extra, of which they do not need the rest.
    assert elsewhere == {("serving", name) for name in optional - {"litellm"}} | {("dev", "fastmcp")}


def test_the_ranges_of_served_packages_are_those_of_the_extra() -> None:
    """The embedded agent, the first build of an environment and SERVE repeat what pyproject.toml has."""
    project = tomllib.loads((TOP / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    known = {Requirement(text).name: text for text in (*project["dependencies"], *extras["serving"])}
    assert {"fastmcp", "pyserial", "opencv-python-headless"} <= known.keys()
    found = set()
    pages = (TOP / "octoform" / "diagnostics" / "pages").glob("*.md")
    for path in (*(TOP / "octoform").rglob("*.py"), TOP / "protocol" / "serve.md", *pages):
        # What a lock of an example has is one version, and no range.
        for text in (text for text in SERVED.findall(path.read_text()) if "==" not in text):
            found.add(text)
            assert known[Requirement(text).name] == text, path
    assert {known["fastmcp"], known["pyserial"], known["opencv-python-headless"]} <= found
    assert known["fastmcp"] in extras["dev"], "the tests' client is of the same range"


# What carries out a repair, decides on it, or keeps what became of it.
REPAIRS = (
    "daemon/",
    "engine/unattended/",
    "apply/duty.py",
    "apply/heal.py",
    "apply/watch.py",
    "apply/repair_outcome.py",
)
OUTCOME = "apply/repair_outcome.py"
# A shape of an outcome has a word for how something went beside a word for why, as fields of a class or as keys.
HOW = {"again", "done", "failed", "helped", "ok", "outcome", "refused", "repaired", "succeeded", "verdict", "worked"}
WHY = {"detail", "message", "reason", "reasons", "said", "text", "why"}
DECISION = {OUTCOME, "daemon/repair/playbook.py", "daemon/reconcile/repairs.py"}
MAX_OPENED = 5


def repair_sources() -> dict[str, str]:
    names = {path.relative_to(ROOT).as_posix(): path for path in FILES}
    return {name: path.read_text() for name, path in names.items() if name.startswith(REPAIRS)}


def outcome_shapes(source: str) -> list[str]:
    """The classes, and the lines of dictionaries, that are an outcome of their own."""
    found = []
    for node in parsed.nodes(source):
        if isinstance(node, ast.ClassDef):
            fields = [each.target for each in node.body if isinstance(each, ast.AnnAssign)]
            words, name = {each.id for each in fields if isinstance(each, ast.Name)}, node.name
        elif isinstance(node, ast.Dict):
            words = {str(each.value) for each in node.keys if isinstance(each, ast.Constant)}
            name = f"line {node.lineno}"
        else:
            continue
        if words & HOW and words & WHY:
            found.append(name)
    return found


def test_what_became_of_a_repair_has_one_shape() -> None:
    shapes = {name: outcome_shapes(source) for name, source in repair_sources().items()}
    assert {name: found for name, found in shapes.items() if found and name != OUTCOME} == {}
    assert "RepairOutcome" in shapes[OUTCOME]


def test_a_second_shape_of_an_outcome_is_found() -> None:
    assert outcome_shapes("class Mended:\n    ok: bool\n    detail: str = ''") == ["Mended"]
    assert outcome_shapes("def mend():\n    return {'ok': True, 'why': 'it runs'}") == ["line 2"]
    assert outcome_shapes("class Start:\n    why: str | None\n    uptime: float") == []


def rules(source: str, names: set[str]) -> set[str]:
    """The rules of reasons in a source: ``where.rule`` with one of these as its first word."""
    texts = {each.value for each in parsed.nodes(source) if isinstance(each, ast.Constant)}
    form = re.compile(rf"(?:{'|'.join(sorted(names))})\.[a-z][a-z-]+")
    return {each for each in texts if isinstance(each, str) and form.fullmatch(each)}


def test_the_rule_that_refused_a_repair_leads_to_one_file_and_all_of_a_repair_to_five() -> None:
    documented = (TOP / "docs" / "daemon.md").read_text().partition("| where | is |")[2].partition("\n\n")[0]
    wheres = {word for line in documented.splitlines()[2:] for word in line.split("|")[1].split("`")[1::2]}
    assert {"loop", "check", "worker", "restart", "roll_back"} <= wheres
    found = {name: rules(source, wheres) for name, source in repair_sources().items()}
    places = Counter(rule for each in found.values() for rule in each)
    assert len(places) > 40
    assert [rule for rule, count in places.items() if count > 1] == []
    opened = {where: {name for name in found if rules(repair_sources()[name], {where})} | DECISION for where in wheres}
    assert {where: sorted(names) for where, names in opened.items() if len(names) > MAX_OPENED} == {}


def untyped_arguments(source: str) -> list[str]:
    """The ways in which a source reads what was typed without its types."""
    found = []
    for node in parsed.nodes(source):
        if "Namespace" in (getattr(node, "id", ""), getattr(node, "attr", ""), getattr(node, "name", "")):
            found.append("argparse.Namespace")
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            typed = any(keyword.arg == "namespace" for keyword in node.keywords)
            if node.func.attr.startswith("parse_") and node.func.attr.endswith("args") and not typed:
                found.append(node.func.attr)
    return found


def test_what_was_typed_is_read_with_its_types() -> None:
    """The one parser of commands gives all that argparse found to the class that declares it."""
    found = {path.relative_to(ROOT).as_posix(): untyped_arguments(path.read_text()) for path in FILES}
    assert {name: ways for name, ways in found.items() if ways} == {"cli/parser.py": ["parse_known_args"]}
    assert "return arguments(**vars(found))" in (ROOT / "cli" / "parser.py").read_text()


@for_each(
    "line",
    [
        "from argparse import Namespace",
        "def run(arguments: argparse.Namespace) -> int: ...",
        "given = parser.parse_args(words)",
        "given, rest = parser.parse_known_args(words)",
    ],
)
def test_the_rule_sees_arguments_without_types(line: str) -> None:
    assert untyped_arguments(line) != []
    assert untyped_arguments("given = parser.parse_args(words, namespace=Given())") == []


# Who has the name of a tool beside arguments, and is not a call on its way to the endpoint.
OTHER_CARRIERS = {
    "claims/model.py": ["Restriction"],  # calls that are forbidden, by values of some arguments
    "harness/react/agent_tools.py": ["Ready"],  # a tool of an agent, on its own files
    "perception/frames.py": ["Camera"],  # the record of a picture, as it lies on disk
    "policy/__init__.py": ["Call"],  # what a limit is asked about, with what counted before it
    "server/restrictions.py": ["Subject", "Entry"],  # what a restriction is asked about, and what is restricted
}


def carriers(source: str) -> list[str]:
    """The classes with a field for a tool and one for its arguments, typed or given in ``__init__``."""
    found = []
    for node in parsed.nodes(source):
        if isinstance(node, ast.ClassDef):
            fields = {
                each.target.id
                for each in node.body
                if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name)
            }
            inits = [each for each in node.body if isinstance(each, ast.FunctionDef) and each.name == "__init__"]
            fields |= {argument.arg for each in inits for argument in (*each.args.args, *each.args.kwonlyargs)}
            found += [node.name] if "tool" in fields and fields & {"arguments", "pairs", "given", "params"} else []
    return found


def test_a_call_has_one_type_from_the_command_line_to_the_gate() -> None:
    found = {path.relative_to(ROOT).as_posix(): carriers(path.read_text()) for path in FILES}
    assert {name: names for name, names in found.items() if names} == {
        "endpoint/client/jsonrpc.py": ["ToolCall"],
        **OTHER_CARRIERS,
    }
    assert carriers("class A:\n  tool: str\n  pairs: list\nclass B:\n  def __init__(self, tool, given): ...\n") == [
        "A",
        "B",
    ]
