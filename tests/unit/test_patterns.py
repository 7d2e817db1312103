"""An expression of a module is what the library compiles, and no start of a process waits for it."""

import copy
import re
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest
from cases import for_each

from octoform.patterns import regex

USES: dict[str, Callable[[Any], object]] = {
    "search": lambda words: words.search("a Word").span(),
    "search from a place": lambda words: words.search("Word, word", 4).span(),
    "match": lambda words: words.match("word by word").groups(),
    "fullmatch": lambda words: words.fullmatch("word by word"),
    "split": lambda words: words.split("a word of words", maxsplit=1),
    "findall": lambda words: words.findall("word, WORD"),
    "finditer": lambda words: [found.start() for found in words.finditer("word, WORD")],
    "sub": lambda words: words.sub(r"<\1>", "word, WORD", count=1),
    "subn": lambda words: words.subn("", "word, WORD"),
    "pattern": lambda words: words.pattern,
    "flags": lambda words: words.flags,
    "groups": lambda words: words.groups,
    "copy": lambda words: copy.deepcopy(words).findall("word"),
}
SOURCE = r"\b(word)"
# Programs do their work when they are imported, and templates are no modules.
COMPILE_ALL = """
import gc, importlib, pkgutil, re
import octoform
from octoform.patterns import regex
names = [found.name for found in pkgutil.walk_packages(octoform.__path__, "octoform.")]
names = [name for name in names if not {"__main__", "templates", "shipped", "scripts"} & {*name.split(".")}]
for name in names:
    importlib.import_module(name)
ours = [each for each in gc.get_objects() if type(each) is type(regex(""))]
for each in ours:
    re.compile(each.pattern, each.flags)
print(len(names), len(ours))
"""


@for_each("use", sorted(USES))
def test_it_does_what_the_librarys_does(use: str) -> None:
    ours = regex(SOURCE, re.IGNORECASE)
    expected = USES[use](re.compile(SOURCE, re.IGNORECASE))
    assert [USES[use](ours), USES[use](ours)] == [expected, expected]


def test_it_is_compiled_once_and_not_before_it_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    compiled: list[tuple[Any, ...]] = []
    compile_ = re.compile

    def noted(*given: Any) -> Any:
        compiled.append(given)
        return compile_(*given)

    monkeypatch.setattr(re, "compile", noted)
    ours = regex(rb"\d+", flags=re.ASCII)
    assert compiled == []
    assert [ours.findall(b"1 22"), ours.sub(b"", b"1 22")] == [[b"1", b"22"], b" "]
    assert compiled == [(rb"\d+", re.ASCII)]


def test_a_mistake_is_an_error_at_the_first_use() -> None:
    wrong = regex("(")
    with pytest.raises(re.error):
        wrong.search("")


def test_every_expression_of_a_module_compiles() -> None:
    """Without this a mistake in an expression that few runs use would end one of those."""
    # In a process of its own: the tests' own modules are frozen, and no longer among what the collector lists.
    done = subprocess.run([sys.executable, "-c", COMPILE_ALL], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    modules, expressions = map(int, done.stdout.split())
    assert modules > 400 and expressions > 300
