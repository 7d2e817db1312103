"""How much there is: lines of our own code, specs and tests, package by package (no blank lines, no comments).

``python bench/line_count.py``
"""

import io
import tokenize
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SKIPPED = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}


def code_lines(path: Path) -> int:
    """Lines that hold at least one token that is no comment; docstrings count."""
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(path.read_text("utf-8")).readline):
        if token.type not in SKIPPED:
            lines.update(range(token.start[0], token.end[0] + 1))
    return len(lines)


def main() -> None:
    """Print the table."""
    counts: Counter[str] = Counter()
    for path in sorted((ROOT / "octoform").rglob("*.py")):
        parts = path.relative_to(ROOT / "octoform").parts
        counts[parts[0].removesuffix(".py")] += code_lines(path)
    for name, count in counts.most_common():
        print(f"{count:>7,}  octoform/{name}")
    agent = counts["builtin"] + counts["runtime"]
    print(f"{sum(counts.values()) - agent:>7,}  core in all")
    print(f"{agent:>7,}  embedded agent and runtime")
    specs = sum(len(path.read_text("utf-8").splitlines()) for path in (ROOT / "protocol").glob("*.md"))
    print(f"{specs:>7,}  lines of specs")
    tests = sum(code_lines(path) for path in (ROOT / "tests").rglob("*.py"))
    print(f"{tests:>7,}  lines of tests")


if __name__ == "__main__":
    main()
