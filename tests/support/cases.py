"""One item for many cases: a test that is passed with each value of a parameter, and names all that failed.

An item of pytest costs its share of collection, of fixtures and of the talk between workers, whatever it does. Cases
that take milliseconds are therefore passed inside one item, or inside a few where hundreds of them would keep one
worker busy when the others have ended. Ones that take long, or that a person wants to run alone, stay parametrised.

Of a long list of cases of one kind `make test` passes a share, the same one each time; `make test WHOLE=1` passes all.
"""

import functools
import inspect
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import pytest

Test = Callable[..., None]
MAX_FAILURES = 20
"""How many are shown in full: a rule that is broken fails for hundreds."""


Case = TypeVar("Case")


def share(cases: Iterable[Case], every: int, kind: Callable[[Case], object] | None = None) -> list[Case]:
    """Every so many-th of the cases, and the first of each kind; all of them where WHOLE is set and not empty."""
    if os.environ.get("WHOLE") or every == 1:
        return list(cases)
    kinds: set[object] = set()
    kept = []
    for number, case in enumerate(cases):
        of_kind = kind(case) if kind else None
        if number % every == 0 or of_kind not in kinds:
            kept.append(case)
        kinds.add(of_kind)
    return kept


def for_each(
    parameter: str | tuple[str, ...],
    cases: Iterable[Any],
    parts: int = 1,
    *,
    every: int = 1,
    kind: Callable[[Any], object] | None = None,
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Pass a test with every case as ``parameter``; it fails with one exception a case that failed.

    Of several parameters each case is a tuple. Several can be stacked. A test that takes ``tmp_path`` gets a new folder
    for each case; all other fixtures are shared. With ``parts`` there are so many items, each with its part of the
    cases. With ``every`` and ``kind`` it is passed with a `share` of them.
    """
    names = (parameter,) if isinstance(parameter, str) else parameter
    values = [(case,) if isinstance(parameter, str) else tuple(case) for case in share(cases, every, kind)]
    assert values, f"no case for {parameter}"

    def decorate(test: Test) -> Test:
        @functools.wraps(test)
        def passed(part: int = 0, **fixtures: Any) -> None:
            failures: list[Exception] = []
            for number, case in enumerate(values[part::parts]):
                try:
                    test(**dict(zip(names, case, strict=True)), **_own_folder(fixtures, number))
                except (AssertionError, ExceptionGroup) as problem:
                    problem.add_note(_described(names, case))
                    failures.append(problem)
                except Exception as problem:
                    problem.add_note(_described(names, case))
                    raise
            if failures:
                tried = len(values[part::parts])
                raise ExceptionGroup(f"{len(failures)} of {tried} cases failed", failures[:MAX_FAILURES])

        signature = inspect.signature(test)
        kept = [item for name, item in signature.parameters.items() if name not in names]
        kept += [inspect.Parameter("part", inspect.Parameter.KEYWORD_ONLY)] if parts > 1 else []
        passed.__signature__ = signature.replace(parameters=kept)  # type: ignore[attr-defined]
        del passed.__wrapped__  # pytest would take the parameters of what is wrapped
        return pytest.mark.parametrize("part", range(parts))(passed) if parts > 1 else passed

    return decorate


def _described(names: tuple[str, ...], case: tuple[Any, ...]) -> str:
    return ", ".join(f"{name} = {getattr(value, 'name', value)!r}" for name, value in zip(names, case, strict=True))


def _own_folder(fixtures: dict[str, Any], number: int) -> dict[str, Any]:
    folder = fixtures.get("tmp_path")
    if not isinstance(folder, Path):
        return fixtures
    own = folder / str(number)
    own.mkdir()
    return {**fixtures, "tmp_path": own}
