"""A table that fits the terminal: the columns that matter least go first, the last one wraps."""

import textwrap
from collections.abc import Iterator, Sequence

from octoform.records import dataclass
from octoform.views.format.values import one_line

GAP = "  "
LEAST_LAST = 24


@dataclass(frozen=True, slots=True)
class Column:
    """One column; ``goes`` shows which is omitted first where room is short (0: never), ``most`` cuts its cells."""

    head: str
    right: bool = False
    goes: int = 0
    most: int = 40


def lines(columns: Sequence[Column], rows: Sequence[Sequence[str]], width: int) -> Iterator[str]:
    """The head, then the rows, each line at most ``width`` wide; cells are foreign text."""
    shown = _fitting(columns, rows, width)
    widths = [_width(columns, rows, index) for index in shown]
    room = width - sum(widths[:-1]) - len(GAP) * (len(shown) - 1)
    widths[-1] = max(1, min(widths[-1], room))
    chosen = [columns[index] for index in shown]
    yield _line(chosen, [column.head for column in chosen], widths)
    for row in rows:
        cells = [one_line(row[index], columns[index].most) for index in shown]
        wrapped = textwrap.wrap(cells[-1], widths[-1]) or [""]
        yield _line(chosen, [*cells[:-1], wrapped[0]], widths)
        before = " " * (sum(widths[:-1]) + len(GAP) * (len(shown) - 1))
        yield from (before + rest for rest in wrapped[1:])


def _fitting(columns: Sequence[Column], rows: Sequence[Sequence[str]], width: int) -> list[int]:
    """Indexes of the columns that there is room for."""
    shown = list(range(len(columns)))
    while _least(columns, rows, shown) > width:
        leaving = [index for index in shown if columns[index].goes]
        if not leaving:
            break
        shown.remove(min(leaving, key=lambda index: columns[index].goes))
    return shown


def _least(columns: Sequence[Column], rows: Sequence[Sequence[str]], shown: Sequence[int]) -> int:
    widths = [_width(columns, rows, index) for index in shown]
    return sum(widths[:-1]) + min(widths[-1], LEAST_LAST) + len(GAP) * (len(shown) - 1)


def _width(columns: Sequence[Column], rows: Sequence[Sequence[str]], index: int) -> int:
    cells = (one_line(row[index], columns[index].most) for row in rows)
    return max(len(columns[index].head), *(len(cell) for cell in cells))


def _line(columns: Sequence[Column], cells: Sequence[str], widths: Sequence[int]) -> str:
    padded = (
        cell.rjust(width) if column.right else cell.ljust(width)
        for column, cell, width in zip(columns, cells, widths, strict=True)
    )
    return GAP.join(padded).rstrip()
