"""What a check of the endpoint means around a repair: compared with before, and not with perfection.

Another tool may be broken too, and its device may be unplugged: that is no reason to refuse a repair, and still less to
take an endpoint out of service whose other tools work.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from octoform.apply.serving import Judge
from octoform.contracts.text import shown
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.client.check import CheckReport, TrialCall, judge_check

HINT = "the accepted server stays in service; octoform attempts -stage heal shows what was tried"


def no_worse(before: CheckReport, mended: frozenset[str]) -> Judge:
    """For a candidate: what worked ``before`` works, and the tools that it was to mend answer where they are tried."""
    failed = {(call.tool, call.device) for call in before.calls if _failed(call)}
    worked = {(call.tool, call.device) for call in before.calls if call.ok}

    def judge(report: CheckReport, interface: Mapping[str, Any]) -> list[Diagnostic]:
        still = {(tool, device) for tool, device in failed if tool not in mended}
        calls = tuple(call for call in report.calls if (call.tool, call.device) not in still)
        found = judge_check(replace(report, calls=calls), interface)
        for call in calls:
            if _failed(call) and call.tool in mended:
                found.append(_problem("HEAL-NOT-HELPED", f"{shown(call.tool)} still fails", call))
            elif _failed(call) and (call.tool, call.device) in worked:
                found.append(_problem("HEAL-WORSE", f"{shown(call.tool)} worked before and fails now", call))
        return found

    return judge


def _failed(call: TrialCall) -> bool:
    return call.skipped is None and not call.ok


def _problem(code: str, summary: str, call: TrialCall) -> Diagnostic:
    said = f"{call.error_class}: {call.message}" if call.message else call.error_class
    return error(code, f"with the rewritten server {summary}", detail=said, hint=HINT)
