"""Names that a foreign package keeps to itself are used in one module, where each has its reason.

What begins with an underline may change with any release. `tests/unit/server/test_server_internals.py` shows that each
of these names still does what it is used for.
"""

import ast
import re
from collections import Counter
from pathlib import Path

from architecture.parsed import nodes

ROOT = Path(__file__).parents[2] / "octoform"
FILES = [path for path in sorted(ROOT.rglob("*.py")) if not path.is_symlink()]
HOME = "server/internals.py"
HELD = {
    *("_mcp_server", "_lifespan_manager", "_mask_error_details", "_extensions", "_components"),
    *("_request_handlers", "_notification_handlers", "_connection"),
    *("_server_instances", "_session_owners", "_discard_session"),
    *("_backends", "_asyncio", "_core", "_eventloop"),
}
# The standard library's: documented, or of one minor version of Python, against which the tests run.
DOCUMENTED = {"_exit", "_getframe", "_current_frames", "_asdict", "_fields", "_replace"}
STANDARD = {"_actions", "_choices_actions", "_SubParsersAction", "_option_string_actions", "_run", "_signal"}
PRIVATE = re.compile(r"_[A-Za-z]\w*")
OWN = {"self", "cls", "super()"}


def named(source: str) -> list[str]:
    """The private names that a module uses of something else: as attributes, in imports, and as words for getattr."""
    found = []
    for node in nodes(source):
        if isinstance(node, ast.Attribute):
            found += [node.attr] if ast.unparse(node.value) not in OWN else []
        elif isinstance(node, ast.ImportFrom):
            found += [*(node.module or "").split("."), *(alias.name for alias in node.names)]
        elif isinstance(node, ast.Import):
            found += [part for alias in node.names for part in alias.name.split(".")]
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("getattr", "setattr", "hasattr", "delattr"):
            found += [str(word.value) for word in node.args[1:2] if isinstance(word, ast.Constant)]
    return [name for name in found if PRIVATE.fullmatch(name)]


def made(source: str) -> set[str]:
    """The private names that a module gives itself: functions, classes, members, fields."""
    found = set()
    for node in nodes(source):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.add(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and ast.unparse(node.value) in OWN:
            found.add(node.attr)
    return found


def foreign(source: str) -> Counter[str]:
    """The private names of others, with how often each is used."""
    return Counter(name for name in named(source) if name not in made(source) | DOCUMENTED | STANDARD)


def test_private_names_of_foreign_packages_are_used_in_one_module() -> None:
    found = {path.relative_to(ROOT).as_posix(): foreign(path.read_text()) for path in FILES}
    assert {name: names for name, names in found.items() if names and name != HOME} == {}
    assert set(found[HOME]) == HELD


def test_the_rule_sees_each_form_and_no_name_of_ones_own() -> None:
    source = (
        "from a._b import c\nimport d._e\nx.f._g = getattr(x, '_h')\nclass K:\n  def _m(self): self._n = other._n\n"
    )
    assert foreign(source) == Counter(["_b", "_e", "_g", "_h"])
    assert foreign("os._exit(0)\nself._own()\nsuper()._base()\n") == Counter()
