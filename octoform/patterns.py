"""`regex` for the expressions of modules: `re.compile`, but an expression is compiled when it is first used.

The library compiles in Python, a fifth of a millisecond for each. The modules of an apply have five hundred of them,
which was a quarter of importing the contracts, in each process that octoform starts; a run uses few. Light: standard
library only, and that when the first expression is used.
"""

TYPE_CHECKING = False
if TYPE_CHECKING:
    import re
    from typing import Any

    regex = re.compile
else:

    def regex(pattern, flags=0):
        """See `re.compile`. A mistake in the expression is an error where it is first used."""
        return _Expression(pattern, flags)


_METHODS = ("search", "match", "fullmatch", "split", "findall", "finditer", "sub", "subn")


class _Expression:
    """Stands for a compiled expression; from the first use on it has its methods."""

    __slots__ = ("_flags", "pattern", *_METHODS)

    def __init__(self, pattern: "str | bytes", flags: int) -> None:
        self.pattern = pattern
        self._flags = flags

    def __getattr__(self, name: str) -> "Any":
        import re

        compiled = re.compile(self.pattern, self._flags)
        for each in _METHODS:
            setattr(self, each, getattr(compiled, each))
        return getattr(compiled, name)
