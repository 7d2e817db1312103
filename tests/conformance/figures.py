"""Prints what the conformance suites and the Inspector say of the two endpoints that the tests judge:

PYTHONPATH=tests:tests/support .venv/bin/python -m conformance.figures
"""

from collections.abc import Set
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from conformance import judged
from conformance.suites import HANDSHAKE, INSPECTOR, LATER


def main() -> None:
    """Judge both."""
    with TemporaryDirectory(prefix="octoform-judged-") as name, judged.fixtures(Path(name)) as endpoint:
        print("A server with what the suites ask for by name:")
        _all(HANDSHAKE.version, judged.released(endpoint, Path(name, "released")))
        _all(f"{LATER.version}, {judged.REVISION}", judged.later(endpoint, Path(name, "later")))
        _inspected(endpoint)
    with TemporaryDirectory(prefix="octoform-judged-") as name, judged.generated(Path(name)) as endpoint:
        print("What the embedded agent wrote for an invented host:")
        _any(HANDSHAKE.version, judged.released(endpoint, Path(name, "released")), judged.FOR_ANY_SERVER)
        report = judged.later(endpoint, Path(name, "later"))
        _any(f"{LATER.version}, {judged.REVISION}", report, judged.FOR_ANY_SERVER_LATER)
        _inspected(endpoint)


def _all(suite: str, report: Any) -> None:
    checks = [each for checks in report.scenarios.values() for each in checks.items()]
    done, wrong = (sum(count for status, count in checks if status == wanted) for wanted in ("SUCCESS", "FAILURE"))
    print(f"  conformance {suite}: {len(report.passed())} of {len(report.scenarios)} scenarios,", end=" ")
    print(f"checks {done} passed and {wrong} failed, exit status {report.status}", flush=True)
    for failed in report.failed():
        print(f"    not passed: {failed}")


def _any(suite: str, report: Any, scenarios: Set[str]) -> None:
    passed = sorted(set(scenarios) & set(report.passed()))
    print(f"  conformance {suite}: {len(passed)} of {len(scenarios)} scenarios that apply to any server", flush=True)
    for failure in report.failures:
        if failure.split(": ")[0] in scenarios:
            print(f"    {failure}")


def _inspected(endpoint: Any) -> None:
    for way, arguments in (("http", judged.over_http(endpoint)), ("pipe", endpoint.command)):
        status = judged.inspected(*arguments)[0]
        print(f"  inspector {INSPECTOR.version} --strict over {way}: exit status {status}", flush=True)


if __name__ == "__main__":
    main()
