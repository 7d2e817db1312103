"""All findings of one look, causes before what they cause.

The order matters: repairs are made one after the other, and a process that died because its disk is full, its file
damaged or its packages gone is started last. What another finding explains is no finding of its own.
"""

from collections.abc import Collection, Iterable

from octoform.claims.model import Reading
from octoform.daemon.model import Facts, Finding
from octoform.daemon.triage import devices, files, process, resources, signals, tools
from octoform.daemon.triage.failure_history import Recall


def judge(
    facts: Facts,
    before: Facts | None = None,
    recall: Recall | None = None,
    readings: Iterable[Reading] = (),
    given_up: Collection[str] = (),
) -> tuple[Finding, ...]:
    """What is wrong now; empty while an apply is under way, for a host without an endpoint, and when all is well.

    ``before`` are the facts of the look before, ``recall`` what `remember` made of all looks with this one,
    ``readings`` the newest of each signal. The same trouble gives equal keys at each look. ``given_up`` are keys of
    troubles that nobody repairs any more: a process that ended is started again beside them. Where a target and class
    are given up as a whole, other words are no other trouble.
    """
    known = recall or Recall()
    if facts.busy is not None or not (facts.applied or known.applied):
        return ()
    standing = [*resources.disk(facts), *resources.logs(facts), *files.damaged(facts), *files.environment(facts, known)]
    plugged = [*devices.judged(facts, before), *devices.hardware(facts, before)]
    barred = list(resources.port(facts))
    # An edited file stays as long as its person wants it: the endpoint is started with it, or refuses and says why.
    awaited = [each for each in standing if _known(each, given_up).key not in given_up]
    serving = [*barred, *process.judged(facts, known, [*awaited, *barred]), *process.tunnel(facts)]
    using = list(tools.judged(facts, known, [*standing, *plugged, *serving]))
    reported = signals.judged(facts, readings, known.failing, [*serving, *using])
    return _once([_known(each, given_up) for each in (*standing, *plugged, *serving, *using, *reported)])


def _known(finding: Finding, given_up: Collection[str]) -> Finding:
    return finding.broadly if finding.broadly.key in given_up else finding


def _once(found: list[Finding]) -> tuple[Finding, ...]:
    """Each trouble once, told by whoever told it first."""
    return tuple({finding.key: finding for finding in reversed(found)}.values())[::-1]
