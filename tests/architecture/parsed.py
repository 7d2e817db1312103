"""Sources as Python reads them, each parsed once for all tests of the architecture: nobody changes a tree."""

import ast
import functools


@functools.cache
def tree(source: str) -> ast.Module:
    """The syntax tree of a source."""
    return ast.parse(source)


@functools.cache
def nodes(source: str) -> tuple[ast.AST, ...]:
    """All nodes of a source's tree."""
    return tuple(ast.walk(tree(source)))


def forget() -> None:
    """Keep none of them."""
    tree.cache_clear()
    nodes.cache_clear()
