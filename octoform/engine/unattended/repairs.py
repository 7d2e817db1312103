"""The repairs that are heavy: under the state's lock, bounded in time, and never worse than what was there. (Heavy.)

Each gives a `Repaired`; none raises for what the world does. They run in a child of the daemon.
"""

import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass

from octoform.contracts.parsing import parse
from octoform.diagnostics import Diagnostic
from octoform.endpoint.client.check import check, judge_check
from octoform.endpoint.environment.build import build
from octoform.endpoint.environment.model import Environment, at, locate, packages_of
from octoform.endpoint.environment.packages import packages
from octoform.endpoint.environment.wheel_records import altered
from octoform.endpoint.process import lifecycle
from octoform.endpoint.process.desired_state import is_marked
from octoform.endpoint.process.record import running
from octoform.endpoint.publish.expected_tools import shown as shown_tools
from octoform.engine.unattended.restore_files import Mended, mend_artifacts, mend_endpoint
from octoform.state.files import read_regular
from octoform.state.layout import Layout
from octoform.state.store.lock import Waiting, acquire

LOCK_SECONDS = 30.0
"""How long a repair waits for whoever works on the state; behind that it is tried again later."""
BUILD_SECONDS = 300.0
CLEAN_SECONDS = 60.0


@dataclass(frozen=True, slots=True)
class Repaired:
    """How a repair ended: ``detail`` in plain sentences, ``again`` False when no further try can help."""

    ok: bool
    detail: str = ""
    again: bool = True


def restore(layout: Layout) -> Repaired:
    """Put the damaged accepted artifacts and the endpoint's own files back."""
    return _locked(layout, "restore", lambda: _mended(mend_artifacts(layout), mend_endpoint(layout)))


def republish(layout: Layout) -> Repaired:
    """Put the endpoint's own files back as they were published, and see whether it answers."""
    return _locked(layout, "republish", lambda: _republished(layout))


def rebuild(layout: Layout) -> Repaired:
    """Build the serving environment from its lock again, and start the endpoint from it."""
    return _locked(layout, "rebuild", lambda: _rebuilt(layout))


def _locked(layout: Layout, operation: str, work: Callable[[], Repaired]) -> Repaired:
    acquired = acquire(layout, operation, Waiting(timeout=LOCK_SECONDS))
    if acquired.lock is None:
        return Repaired(False, _words(acquired.diagnostics))
    with acquired.lock:
        return work()


def _mended(*parts: Mended) -> Repaired:
    text = "; ".join(filter(None, (part.text for part in parts)))
    if not text:
        return Repaired(True, "every file is as it was accepted")
    failed, lost = any(part.failed for part in parts), any(part.lost for part in parts)
    if any(part.back for part in parts) and not failed and not lost:
        return Repaired(True, text)
    # What is left is left on purpose, and what is lost stays lost: before a person has decided, no try changes that.
    return Repaired(False, text, again=failed)


def _republished(layout: Layout) -> Repaired:
    done = _mended(mend_endpoint(layout))
    if not done.ok or is_marked(layout):
        return done
    interface, _ = read_regular(layout.output("interface"))
    value, found = parse("interface", interface or b"", str(layout.output("interface")))
    if not isinstance(value, dict):
        return Repaired(False, f"{done.detail}; the tools cannot be compared: {_words(found)}")
    report = check(layout, shown_tools(layout, value))
    errors = [item for item in judge_check(report, value) if item.severity == "error"]
    if errors:
        return Repaired(False, f"{done.detail}; the endpoint does not pass its check: {_words(errors)}")
    return Repaired(True, f"{done.detail}; the endpoint answers with {len(report.tools)} tools")


def _rebuilt(layout: Layout) -> Repaired:
    files = mend_artifacts(layout)  # the lock itself may be what is damaged
    lock, problem = read_regular(layout.requirements_lock)
    if lock is None:
        return Repaired(False, _words([problem]) if problem else f"the lock of the endpoint is gone; {files.text}")
    started = time.monotonic()
    text = lock.decode("utf-8", "replace")
    environment, problems = _anew(layout, text)
    wrong = altered(packages_of(environment.path)) if environment is not None else []
    if wrong:
        # An environment shares its files with the package tool's cache, so what was written into one is in both.
        damaged = sorted({item.partition(":")[0] for item in wrong})
        packages(["cache", "clean", *damaged], layout.environments, CLEAN_SECONDS)
        environment, problems = _anew(layout, text)
        wrong = altered(packages_of(environment.path)) if environment is not None else []
    if environment is None:
        return Repaired(False, f"the environment cannot be built, and is as it was: {_words(problems)}")
    detail = f"built the serving environment again in {time.monotonic() - started:.1f} s"
    if wrong:
        return Repaired(False, f"{detail}; files of it are still not those of the lock: {', '.join(wrong[:5])}")
    return _restarted(layout, detail)


def _anew(layout: Layout, lock: str) -> tuple[Environment | None, tuple[Diagnostic, ...]]:
    """A new environment in the place of the one that is there, which comes back when there is no new one."""
    place = locate(layout, lock).path
    aside = place.with_name(f".{place.name}.damaged")
    if at(place) is None and aside.exists():
        shutil.rmtree(place, ignore_errors=True)  # a rebuild that was killed: what it had set aside is the better one
    else:
        shutil.rmtree(aside, ignore_errors=True)
        if place.exists():
            place.rename(aside)
    built, problems = build(layout, lock, BUILD_SECONDS, anew=True)
    if built is None and aside.exists():
        shutil.rmtree(place, ignore_errors=True)
        aside.rename(place)
    shutil.rmtree(aside, ignore_errors=True)
    return built, problems


def _restarted(layout: Layout, detail: str) -> Repaired:
    if is_marked(layout):
        return Repaired(True, f"{detail}; a person has stopped the endpoint, so it is not started")
    if running(layout) is not None:
        if problem := lifecycle.obstacle(layout):
            return Repaired(False, f"{detail}; {_words([problem])}")
        lifecycle.stop(layout)
    process, problem = lifecycle.start(layout)
    if process is None:
        return Repaired(False, f"{detail}; {_words([problem] if problem else [])}")
    return Repaired(True, f"{detail}; the endpoint runs from it")


def _words(found: "list[Diagnostic] | tuple[Diagnostic, ...]") -> str:
    """The first error in one line, with the first line of its detail."""
    first = next((item for item in found if item.severity == "error"), found[0] if found else None)
    if first is None:
        return "no reason was given"
    return ": ".join(filter(None, (first.summary, (first.detail or "").partition("\n")[0])))
