"""The endpoint's process: gone, silent, or ending again and again."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping

from octoform.base.escaping import escaped
from octoform.base.health_status import Status
from octoform.daemon.model import Facts, FaultClass, Finding, Kind, Repair
from octoform.daemon.triage.failure_history import Recall
from octoform.patterns import regex

CRASHES = 3
"""Short lives in the window after which it is a loop, and another start alone no repair."""
TARGET = "endpoint"
THE_START = "the start"
"""The source of a finding from the message of a failed start."""
_BARRED = frozenset({Repair.RESTORE, Repair.REBUILD, Repair.REPUBLISH})


def judged(facts: Facts, recall: Recall, standing: Iterable[Finding]) -> Iterator[Finding]:
    """At most one finding about the process; none while a person wants it stopped.

    ``standing`` is what is wrong with what it stands on: as long as that bars a start, none is tried.
    """
    if facts.stopped_by is not None:
        return
    if facts.process is None:
        if not any(map(_bars, standing)):
            yield _gone(facts, recall)
    elif facts.answers is False:
        summary = "the endpoint's process does not answer"
        then = (Repair.RESTART, Repair.REBUILD)
        fault = FaultClass.DEAD_PROCESS
        yield Finding(
            Kind.PROCESS_HUNG,
            fault,
            TARGET,
            summary,
            ("silent",),
            Repair.RESTART,
            then,
            Status.DOWN,
            _last_message(facts),
        )
    else:
        yield from _stuck(facts)


def tunnel(facts: Facts) -> Iterator[Finding]:
    """A tunnel that ought to run and does not; its own process opens it again, so it is only reported."""
    found = (facts.reported or {}).get("tunnel")
    if isinstance(found, Mapping) and found.get("state") not in ("running", "starting", "revoked"):
        yield Finding(
            Kind.TUNNEL_DOWN,
            FaultClass.NONE,
            "tunnel",
            "the tunnel does not run: the endpoint cannot be reached from the internet",
            ("down",),
            Repair.WAIT,
            detail=escaped(str(found.get("reason") or ""))[:400],
        )


def _bars(finding: Finding) -> bool:
    """Whether a start must wait until this is repaired; the next start proves what only a failed start reported."""
    return finding.kind is Kind.PORT_TAKEN or (finding.repair in _BARRED and finding.data.get("who") != THE_START)


def _gone(facts: Facts, recall: Recall) -> Finding:
    if len(recall.ends) >= CRASHES:
        summary = f"the endpoint's process ended {len(recall.ends)} times soon after its start"
        kind, evidence, first, then = Kind.CRASH_LOOP, ("crash loop",), Repair.REBUILD, (Repair.RESTART, Repair.PERSON)
    else:
        summary, kind = "the endpoint's process is gone", Kind.PROCESS_DEAD
        evidence, first, then = ("gone",), Repair.RESTART, (Repair.RESTART, Repair.REBUILD)
    return Finding(
        kind, FaultClass.DEAD_PROCESS, TARGET, summary, evidence, first, then, Status.DOWN, _last_message(facts)
    )


def _stuck(facts: Facts) -> Iterator[Finding]:
    """Tools whose code has not ended although their time was over: only another process sets their bus free."""
    gate = (facts.reported or {}).get("gate")
    stuck = gate.get("stuck") if isinstance(gate, Mapping) else None
    for name in sorted({_name(each) for each in stuck or ()}):
        yield Finding(
            Kind.PROCESS_HUNG,
            FaultClass.DEAD_PROCESS,
            f"tool:{name}",
            f"{name} has not ended although it was stopped, and holds its device",
            ("stuck", name),
            Repair.RESTART,
            (Repair.WATCH,),
            data={"tool": name},
        )


def _name(stuck: object) -> str:
    return escaped(str(stuck.get("tool", "a tool")) if isinstance(stuck, Mapping) else str(stuck))[:80]


def _last_message(facts: Facts) -> str:
    """The last output of the process or of its start, bounded."""
    return escaped(facts.start_failed or "\n".join(facts.printed[-10:]), keep="\n")[:1500]


# The files that the endpoint needs: accepted artifacts, published files, environment; and what only a person repairs.
#
# The reasons of `octoform.endpoint.drift` and `octoform.endpoint.environment.model` are sentences for people;
# this is the one place where they are sorted, and what is in no known sentence counts as a damage of the published
# files.

MAX_FILES = 50
FOREIGN = "foreign"
"""The reason in `Facts.damaged` for a file beside the accepted ones that is none of them."""
SINGLE = 3
"""Damaged files of one folder that are reported one by one; more are reported as the folder."""
_STAGE_PARTS = 3
_PACKAGE = regex(r"^(?P<name>[A-Za-z0-9][\w.-]*) (?:\S+ )?(?:is gone from|was added to|-> \S+ in) the serving env")
_CONFLICT = regex(r"was added to the serving environment|both provide|provided by (two|several)")
_SERVED = regex(r"^(server\.py|the runtime)\b")
_OTHER_SERVER = regex(r"^server\.py is not the one that the endpoint was made for$")
"""A damaged one is reported by its path; one that was accepted since is reported as such."""
_ELSEWHERE = regex(r"^the endpoint is not running$|tools differ|did not answer when it was last checked")
"""Reasons that are about the process, or about a check of former days: the process itself is asked instead."""
_OF_PERSON = regex(r"built for another set of packages|published by another version of octoform")
"""Nothing is damaged, and what was applied serves; a person's apply brings the other in."""
_MISSING = regex(r"No module named '?(?P<name>[A-Za-z_]\w*)")
_IMPORT = regex(r"\b(ModuleNotFoundError|ImportError)\b|/site-packages/")


def damaged(facts: Facts) -> Iterator[Finding]:
    """Files that are not as they were accepted or published, each with what puts it right."""
    ours = {path: how for path, how in facts.damaged.items() if how != FOREIGN}
    folders = Counter(map(_folder, ours))
    for path, how in sorted(ours.items())[:MAX_FILES]:
        if folders[_folder(path)] <= SINGLE:
            yield _file(facts.host, path, how)
    for folder, count in sorted(folders.items()):
        if count > SINGLE:
            yield _file(facts.host, folder, f"has {count} files that are not as they were accepted")
    for path in sorted(set(facts.damaged) - set(ours))[:SINGLE]:
        yield _foreign(path)
    yield from _adopted(facts)
    reasons = sorted(reason for reason in facts.endpoint if _is_published(reason, facts))
    if not facts.applied:
        reasons.append("the endpoint's manifest is gone or damaged")
    if reasons:
        fault, summary = (
            FaultClass.CORRUPTED_FILE,
            reasons[0] if len(reasons) == 1 else f"{len(reasons)} files of the endpoint",
        )
        then = (Repair.REPUBLISH, Repair.PERSON)
        detail = "\n".join(reasons)[:1500]
        kind = Kind.FILE_DAMAGED
        yield Finding(kind, fault, "endpoint:files", summary, tuple(reasons), Repair.REPUBLISH, then, detail=detail)


def environment(facts: Facts, recall: Recall) -> Iterator[Finding]:
    """Packages that are gone, changed or in each other's way, by their names or by a failed import."""
    for reason in sorted({*facts.environment, *(each for each in facts.endpoint if "serving environment" in each)})[
        :MAX_FILES
    ]:
        yield _package(reason)
    if not facts.environment:
        yield from _imports(facts, recall)


def _folder(path: str) -> str:
    """``state/bench/serve`` for all that lies below it."""
    return "/".join(path.split("/")[:_STAGE_PARTS])


def _file(host: str, path: str, how: str) -> Finding:
    target, evidence = f"file:{path}", (path, how)
    words = {"missing": "is missing", "changed": "is not as it was accepted", "link": "is a link, which it must not be"}
    summary = f"{path} {words.get(how, how)}"
    kind, fault = Kind.FILE_DAMAGED, FaultClass.CORRUPTED_FILE
    if path.startswith(f"state/{host}/") and not path.endswith("/state.json"):
        then = (Repair.RESTORE, Repair.PERSON)
        return Finding(kind, fault, target, summary, evidence, Repair.RESTORE, then, data={"path": path})
    if path.startswith(f".octoform/{host}/endpoint/"):
        then = (Repair.REPUBLISH, Repair.PERSON)
        return Finding(kind, fault, target, summary, evidence, Repair.REPUBLISH, then, data={"path": path})
    kind, fault, data = Kind.STATE_DAMAGED, FaultClass.NONE, {"path": path}
    return Finding(kind, fault, target, summary, evidence, Repair.PERSON, status=Status.ERROR, data=data)


def _foreign(path: str) -> Finding:
    """A file that no one accepted, beside those that were: perhaps a person's, so nothing but to say so."""
    kind, fault, target = Kind.FILE_DAMAGED, FaultClass.NONE, f"file:{path}"
    detail = "move it to another folder; what lies in a stage's folder is taken for part of its artifact"
    summary = f"{path} is none of the files that were accepted"
    return Finding(kind, fault, target, summary, (path, FOREIGN), Repair.PERSON, detail=detail, data={"path": path})


def _is_published(reason: str, facts: Facts) -> bool:
    if _ELSEWHERE.search(reason) or _OF_PERSON.search(reason) or "serving environment" in reason:
        return False
    if _OTHER_SERVER.match(reason):
        return False
    # A damaged runtime is reported by its path; without one, publishing again is what puts it right.
    return not (_SERVED.match(reason) and _is_served_damaged(facts))


def _is_served_damaged(facts: Facts) -> bool:
    return any("/serve/" in path for path in facts.damaged)


def _adopted(facts: Facts) -> Iterator[Finding]:
    """A server that is accepted as it lies there and is not the one in service: to publish it is a person's apply."""
    reason = next((each for each in facts.endpoint if _OTHER_SERVER.match(each)), None)
    if reason is not None and facts.applied and not _is_served_damaged(facts):
        target = f"file:state/{facts.host}/serve/server.py"
        summary = "the accepted server is another one than the endpoint serves"
        detail = "octoform apply brings it into service (octoform plan shows first what it would do)"
        kind, fault = Kind.FILE_DAMAGED, FaultClass.NONE
        yield Finding(kind, fault, target, summary, ("adopted",), Repair.PERSON, detail=detail)


def _package(reason: str) -> Finding:
    match = _PACKAGE.match(reason)
    target = f"package:{match['name']}" if match else "environment"
    kind = Kind.PACKAGE_CONFLICT if _CONFLICT.search(reason) else Kind.PACKAGE_DAMAGED
    then = (Repair.REBUILD, Repair.PERSON)
    return Finding(kind, FaultClass.DEPENDENCY, target, reason, (reason,), Repair.REBUILD, then, Status.ERROR)


def _imports(facts: Facts, recall: Recall) -> Iterator[Finding]:
    """A package whose files are damaged inside is reported by what imports it: a tool, or a start that failed."""
    fields = {f"tool {name}": f"{each.error}: {each.message}" for name, each in sorted(recall.failing.items())}
    if facts.process is None and facts.stopped_by is None and facts.start_failed:
        fields[THE_START] = facts.start_failed
    for who, text in fields.items():
        if not _IMPORT.search(text):
            continue
        match = _MISSING.search(text)
        target = f"package:{match['name']}" if match else "environment"
        summary = f"a library is missing or broken: {who} could not import {match['name'] if match else 'it'}"
        then = (Repair.WATCH, Repair.PERSON)
        evidence = ("import", target)
        kind, fault = Kind.PACKAGE_DAMAGED, FaultClass.DEPENDENCY
        yield Finding(
            kind, fault, target, summary, evidence, Repair.REBUILD, then, Status.ERROR, text[:1500], {"who": who}
        )


# The room that a deployment has on its machine: the disk, its logs, the port.

LEAST_FREE = 64_000_000
"""Bytes below which a state, a log or a built environment may not be written any more."""
LARGEST_LOG = 10_000_000
"""Bytes above which a log is archived."""
_ASIDE = regex(r"\.\d+(\.\w+)?$")
_PORT = regex(r"address already in use|\bports?\b.{0,80}\b(taken|in use|free)\b|\b(taken|in use)\b.{0,40}\bport", re.I)


def disk(facts: Facts) -> Iterator[Finding]:
    """A disk that is nearly full: what can be made again is dropped."""
    if facts.disk_free is not None and facts.disk_free < LEAST_FREE:
        yield Finding(
            Kind.DISK_FULL,
            FaultClass.NONE,
            "disk",
            f"the disk of the project has {facts.disk_free // 1_000_000} MB left",
            ("full",),
            Repair.ROTATE,
            (Repair.PERSON,),
            Status.ERROR,
            data={"free": facts.disk_free, "wanted": LEAST_FREE},
        )


def logs(facts: Facts) -> Iterator[Finding]:
    """Logs that outgrew their bound; what was archived already (``.1``, ``.2.gz``) stays as it is."""
    for name, size in sorted(facts.log_bytes.items()):
        if size > LARGEST_LOG and not _ASIDE.search(name):
            summary = f"the log {name} has grown to {size // 1_000_000} MB"
            target = f"log:{name}"
            yield Finding(
                Kind.LOG_OVERGROWN,
                FaultClass.NONE,
                target,
                summary,
                ("overgrown",),
                Repair.ROTATE,
                status=Status.HEALTHY,
                data={"name": name, "bytes": size},
            )


def port(facts: Facts) -> Iterator[Finding]:
    """A port that another program holds; its holder is never touched."""
    if facts.process is None and facts.stopped_by is None and facts.start_failed and _PORT.search(facts.start_failed):
        yield Finding(
            Kind.PORT_TAKEN,
            FaultClass.DEAD_PROCESS,
            "endpoint",
            "another program holds the ports of the endpoint",
            ("port",),
            Repair.RESTART,
            (Repair.WAIT,),
            Status.DOWN,
            detail=facts.start_failed,
        )


def beyond_limits(facts: Facts) -> Iterator[Finding]:
    """The units that the endpoint's process holds, because its device reported a place outside of a limit."""
    outside = (facts.reported or {}).get("outside")
    for tool, units in sorted(outside.items()) if isinstance(outside, Mapping) else ():
        for unit, text in sorted(units.items()) if isinstance(units, Mapping) else ():
            place = str(text).partition(" (")[0]  # `octoform limits` has the source of the range
            summary = f"the device reported {unit} {place} after {tool}; look at it, then octoform limits -reset {tool}"
            yield Finding(
                Kind.BEYOND_LIMIT,
                FaultClass.NONE,
                f"tool:{tool}",
                escaped(summary),
                (str(unit),),
                Repair.PERSON,
                data={"tool": tool, "unit": unit},
            )
