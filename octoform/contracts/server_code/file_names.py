"""What the names of a generated server's own file stand for: constants, records, classes and their methods."""

import ast
from collections.abc import Callable, Iterator
from functools import cache, lru_cache
from typing import Any

from octoform.contracts.server_code.computed_values import UNKNOWN
from octoform.contracts.server_code.server_source import Source

_MAX_BASES = 20
_RECORDS = ("NamedTuple", "TypedDict", "BaseModel")


class FileNames:
    """The names of the file itself, each computed once."""

    def __init__(self, source: Source, compute: Callable[[ast.expr], Any]) -> None:
        tables = _tables(source)
        self._compute, self._known, self._constants = compute, dict[str, Any](), tables.constants
        self.method, self.fields = tables.method, tables.fields

    def value(self, name: str) -> Any:
        """The value of a constant of the file; unknown where it is bound more than once."""
        if name not in self._known:
            self._known[name] = UNKNOWN
            if name in self._constants:
                self._known[name] = self._compute(self._constants[name])
        return self._known[name]


class _Tables:
    """The constants and the classes of a file, whatever is computed: each is looked up once."""

    def __init__(self, source: Source) -> None:
        self._source, self._bound = source, _bound(source)
        self._classes = {item.name: item for item in source.classes}
        self.constants = {
            name: values[0]
            for name, values in self._bound.items()
            if len(values) == 1 and not source.dotted(values[0]).endswith("TypedDict()")  # see `fields`
        }
        self.method, self.fields = cache(self._method), cache(self._fields)

    def _method(self, owner: str, name: str, *, above: bool = False) -> tuple[str, ast.FunctionDef] | None:
        """A method of a class of the file, with the class that has it: its own, or one of those it inherits from."""
        for each in list(self._line(owner))[1 if above else 0 :]:
            found = [item for item in each.body if isinstance(item, ast.FunctionDef) and item.name == name]
            if found:
                return (each.name, found[0]) if len(found) == 1 else None
        return None

    def _fields(self, name: str) -> dict[str, ast.expr | None] | None:
        """The members of a record that the file defines, with their defaults; None where it defines none."""
        if name in self._classes:
            members = [item for each in reversed(list(self._line(name))) for item in each.body]
            named = [each for each in members if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name)]
            plain = not any(isinstance(each, ast.FunctionDef) for each in members)
            return {ast.unparse(each.target): each.value for each in named} if plain or self._is_record(name) else None
        made = [self._source.dotted(item) for item in self._bound.get(name, [])]
        return {} if len(made) == 1 and made[0].endswith("TypedDict()") else None

    def _is_record(self, name: str) -> bool:
        """Whether a class with methods takes its members when it is made."""
        every = list(self._line(name))
        said = [item for each in every for item in (*each.decorator_list, *each.bases)]
        words = [self._source.dotted(item).removesuffix("()").rpartition(".")[2] for item in said]
        return any(word == "dataclass" or word in _RECORDS for word in words)

    def _line(self, name: str) -> Iterator[ast.ClassDef]:
        """A class of the file and those that it inherits from, as far as the file has them."""
        waiting, seen = [name], 0
        while waiting and seen < _MAX_BASES:
            item, seen = self._classes.get(waiting.pop(0)), seen + 1
            if item is not None:
                yield item
                waiting = [each.id for each in item.bases if isinstance(each, ast.Name)] + waiting


@lru_cache(maxsize=4)  # a tool is computed some hundred times
def _tables(source: Source) -> _Tables:
    return _Tables(source)


def _bound(source: Source) -> dict[str, list[ast.expr]]:
    """What each name of the file is bound to."""
    bound: dict[str, list[ast.expr]] = {}
    for item in source.tree.body:
        if isinstance(item, ast.Assign | ast.AnnAssign) and item.value is not None:
            for target in item.targets if isinstance(item, ast.Assign) else [item.target]:
                bound.setdefault(ast.unparse(target), []).append(item.value)
    return bound
