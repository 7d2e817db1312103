"""The repairs that are heavy: under the state's lock, bounded in time, and never worse than what was there. (Heavy.)

None raises for what the world does. They run in a child of the daemon.
"""

import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path

from octoform.apply.repair_outcome import Reason, RepairOutcome, RepairVerdict
from octoform.base import clock
from octoform.contracts.artifact_parser import parse
from octoform.diagnostics import Diagnostic, has_errors
from octoform.endpoint.client.check import check, judge_check
from octoform.endpoint.environment.build import build
from octoform.endpoint.environment.lockfile import packages
from octoform.endpoint.environment.model import Environment, altered, at, locate, packages_of
from octoform.endpoint.expected_tools import display as shown_tools
from octoform.endpoint.process import start_stop
from octoform.endpoint.process.record import is_marked, running
from octoform.endpoint.published_files import CLIENTS, LAUNCHER
from octoform.records import dataclass, field
from octoform.state import artifact_cache, git_repository
from octoform.state.accepted import observe
from octoform.state.artifact_cache import Damage, damage_of, move_aside, read_instances
from octoform.state.files import display, read_regular, write_atomic
from octoform.state.layout import Layout
from octoform.state.model import Snapshot, Status
from octoform.state.store.lock import Waiting, acquire
from octoform.state.store.store import StateStore

# Put back what was accepted and what is served, where it is damaged; an edit of a person stays. (Heavy: the state.)
#
# What is damage and what is an edit is defined in `octoform.state.artifact_cache`. Three rules beside it:
#
# * Only what the state calls accepted is put back: what a run has left unfinished is for the next apply.
# * An edited server does no harm while the endpoint runs, since the process has its code already; the endpoint refuses
# to be started from it. So the edit stays as long as the endpoint runs or a person has stopped it. When the endpoint
# is down and could not come back because of it, the edit is moved away, is named, and what was accepted is served.
# * The endpoint's own files are written by octoform alone; all of them are put back but clients' configurations that
# somebody has edited, which decide nothing.
#
# What is not kept on this machine, as in a fresh clone, is taken from git where a commit holds the very files that the
# state accepted. Nothing is guessed: `octoform apply` makes the rest again.

ADOPTING = "adopting.json"
SERVE = "serve"


@dataclass
class Restored:
    """The result of a restore, in sentences: what is put ``back``, what was ``left`` and why, where the former is."""

    back: list[str] = field(default_factory=list)
    left: list[str] = field(default_factory=list)
    aside: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)
    """The files that no repair of the daemon can restore."""

    @property
    def text(self) -> str:
        """All of it in one line each."""
        lines = [f"put back {', '.join(self.back)}"] if self.back else []
        lines += [f"what was there lies in {', '.join(self.aside)}"] if self.aside else []
        return "; ".join([*lines, *self.left, *self.failed, *self.lost])


def restore_artifacts(layout: Layout) -> Restored:
    """Put every damaged accepted artifact back. The caller holds the state's lock."""
    done = Restored()
    store, found = StateStore.open(layout)
    if store is None or has_errors(found):
        done.lost.append(f"the state cannot be read: {_file_problem(found)}; octoform state explains how to recover it")
        return done
    facts = observe(layout)
    for node, wanted in _accepted(layout, store.snapshot, done).items():
        there = facts.get(node)
        if there is not None and there.digest == wanted:
            continue
        files = artifact_cache.kept(layout, node, wanted) or _committed(layout, node, wanted)
        if files is None:
            done.lost.append(
                f"{node} is not as it was accepted, and neither a kept copy nor a commit holds it; "
                "octoform plan shows what apply would do"
            )
            continue
        _restore_folder(layout, layout.folder(node), files, done, hold=node != SERVE or _holds(layout))
    return done


def _committed(layout: Layout, node: str, wanted: str) -> dict[str, bytes] | None:
    """The accepted files as a commit of the project has them; None when none of the last ones does."""
    versions = git_repository.versions(layout.project, layout.folder(node))
    return next((files for files in versions if files and artifact_cache.folder_digest(files) == wanted), None)


def restore_endpoint(layout: Layout) -> Restored:
    """Put every damaged file of the endpoint, and the ledger of instances, back as it was published or written last."""
    done = Restored()
    files = artifact_cache.kept(layout, artifact_cache.ENDPOINT)
    if files is None:
        done.lost.append("no copy of the endpoint's files is kept; octoform apply writes them again")
    else:
        owned = {name: data for name, data in files.items() if not name.startswith(f"{CLIENTS}/")}
        _restore_folder(layout, layout.endpoint, owned, done, hold=False)
        fields = {name: data for name, data in files.items() if name not in owned}
        _restore_folder(layout, layout.endpoint, fields, done, hold=True)
    instances = artifact_cache.kept(layout, artifact_cache.INSTANCES)
    if instances is not None and read_instances(layout)[0] is None:
        _restore_folder(layout, layout.local, instances, done, hold=False)
    return done


def _accepted(layout: Layout, snapshot: Snapshot, done: Restored) -> dict[str, str]:
    """Node to the digest of its files, as far as they may be put back."""
    found = {}
    adopting = os.path.lexists(layout.local / ADOPTING)
    for node, state in snapshot.nodes.items():
        if not state.file_digest:
            continue
        if state.status is not Status.ACCEPTED or (adopting and node == SERVE):
            done.left.append(f"{node} was left unfinished by a run; octoform apply goes on with it")
        else:
            found[node] = state.file_digest
    return found


def _holds(layout: Layout) -> bool:
    """True while an edited server does no harm: the endpoint runs, or a person wants it stopped."""
    return running(layout) is not None or is_marked(layout)


def _restore_folder(layout: Layout, folder: Path, files: artifact_cache.Files, done: Restored, *, hold: bool) -> None:
    """Put the damaged ones of these files back; an edited one only where nothing has to ``hold`` it."""
    stamp = clock.stamp(digits=6)
    _free(layout, folder, stamp, done)
    for name, data in files.items():
        path = folder / name
        for above in reversed(path.relative_to(folder).parents[:-1]):
            _free(layout, folder / above, stamp, done)
        why = damage_of(path, data)
        if why is None:
            _start_again(layout, path, done)
            continue
        if why is Damage.EDITED and hold:
            done.left.append(f"{display(path)} was edited and stays; octoform plan shows it")
            continue
        _put_back(layout, path, data, (stamp, why), done)


def _put_back(layout: Layout, path: Path, data: bytes, why: tuple[str, Damage], done: Restored) -> None:
    aside, problem = move_aside(layout, path, *why)
    if problem is None:
        try:
            path.parent.mkdir(mode=0o700 if path.is_relative_to(layout.local) else 0o755, parents=True, exist_ok=True)
        except OSError as fault:
            done.failed.append(f"{display(path)}: {fault.strerror}")
            return
        problem = write_atomic(path, data, _mode(layout, path))
    if problem is not None:
        done.failed.append(f"{display(path)}: {problem.summary}")
        return
    done.back.append(f"{display(path)} ({why[1]})")
    if aside is not None:
        done.aside.append(display(aside))


def _start_again(layout: Layout, path: Path, done: Restored) -> None:
    """A launcher with the right bytes that no one can start is as good as none."""
    if path != layout.endpoint / LAUNCHER or os.access(path, os.X_OK):
        return
    try:
        path.chmod(_mode(layout, path))
    except OSError as fault:
        done.failed.append(f"{display(path)}: {fault.strerror}")
    else:
        done.back.append(f"{display(path)} (not executable)")


def _free(layout: Layout, folder: Path, stamp: str, done: Restored) -> None:
    """Move away what is where a folder should be."""
    if not os.path.lexists(folder) or (folder.is_dir() and not folder.is_symlink()):
        return
    aside, problem = move_aside(layout, folder, stamp, Damage.LINK)
    if aside is not None:
        done.aside.append(display(aside))
    elif problem is not None:
        done.failed.append(f"{display(folder)}: {problem.summary}")


def _mode(layout: Layout, path: Path) -> int:
    if path == layout.endpoint / LAUNCHER:
        return 0o700
    return 0o600 if path.is_relative_to(layout.local) else 0o644


def _file_problem(found: list[Diagnostic]) -> str:
    return found[0].summary if found else "it is not there"


LOCK_SECONDS = 30.0
"""How long a repair waits for anyone who works on the state; behind that it is tried again later."""
BUILD_SECONDS = 300.0
CLEAN_SECONDS = 60.0


def restore(layout: Layout) -> RepairOutcome:
    """Put the damaged accepted artifacts and the endpoint's own files back."""
    return _locked(layout, "restore", lambda: _repaired(restore_artifacts(layout), restore_endpoint(layout)))


def republish(layout: Layout) -> RepairOutcome:
    """Put the endpoint's own files back as they were published, and see whether it answers."""
    return _locked(layout, "republish", lambda: _republished(layout))


def rebuild(layout: Layout) -> RepairOutcome:
    """Build the serving environment from its lock again, and start the endpoint from it."""
    return _locked(layout, "rebuild", lambda: _rebuilt(layout))


def _locked(layout: Layout, operation: str, work: Callable[[], RepairOutcome]) -> RepairOutcome:
    acquired = acquire(layout, operation, Waiting(timeout=LOCK_SECONDS))
    if acquired.lock is None:
        return RepairOutcome.of_diagnostics(acquired.diagnostics)
    with acquired.lock:
        return work()


def _repaired(*parts: Restored) -> RepairOutcome:
    text = "; ".join(filter(None, (part.text for part in parts)))
    if not text:
        return RepairOutcome.done("restore.whole", "every file is as it was accepted")
    failed, lost = any(part.failed for part in parts), any(part.lost for part in parts)
    if any(part.back for part in parts) and not failed and not lost:
        return RepairOutcome.done("restore.put-back", text)
    # What is left is left on purpose, and what is lost stays lost: before a person has decided, no try changes that.
    return RepairOutcome.failed("restore.left", text, again=failed)


def _republished(layout: Layout) -> RepairOutcome:
    done = _repaired(restore_endpoint(layout))
    if not done.ok or is_marked(layout):
        return done
    interface, _ = read_regular(layout.output("interface"))
    value, found = parse("interface", interface or b"", str(layout.output("interface")))
    if not isinstance(value, dict):
        text = f"the tools cannot be compared: {_words(found)}"
        return done.because("republish.interface", text, verdict=RepairVerdict.FAILED)
    report = check(layout, shown_tools(layout, value))
    errors = [item for item in judge_check(report, value) if item.severity == "error"]
    if errors:
        text = f"the endpoint does not pass its check: {_words(errors)}"
        return done.because("republish.check", text, verdict=RepairVerdict.FAILED)
    return done.because("republish.check", f"the endpoint answers with {len(report.tools)} tools")


def _rebuilt(layout: Layout) -> RepairOutcome:
    files = restore_artifacts(layout)  # the lock itself may be what is damaged
    lock, problem = read_regular(layout.requirements_lock)
    if lock is None:
        text = _words([problem]) if problem else f"the lock of the endpoint is gone; {files.text}"
        return RepairOutcome.refused("rebuild.no-lock", text)
    started = time.monotonic()
    text = lock.decode("utf-8", "replace")
    environment, problems = _built_again(layout, text)
    wrong = altered(packages_of(environment.path)) if environment is not None else []
    if wrong:
        # An environment shares its files with the package tool's cache, so what was written into one is in both.
        damaged = sorted({item.partition(":")[0] for item in wrong})
        packages(["cache", "clean", *damaged], layout.environments, CLEAN_SECONDS)
        environment, problems = _built_again(layout, text)
        wrong = altered(packages_of(environment.path)) if environment is not None else []
    if environment is None:
        text = f"the environment cannot be built, and is as it was: {_words(problems)}"
        return RepairOutcome(RepairVerdict.ROLLED_BACK, (Reason("rebuild.not-built", text),))
    built = f"built the serving environment again in {time.monotonic() - started:.1f} s"
    done = RepairOutcome.done("rebuild.built", built, changed=True)
    if wrong:
        text = f"files of it are still not those of the lock: {', '.join(wrong[:5])}"
        return done.because("rebuild.altered", text, verdict=RepairVerdict.FAILED)
    return _restarted(layout, done)


def _built_again(layout: Layout, lock: str) -> tuple[Environment | None, tuple[Diagnostic, ...]]:
    """A new environment in the place of the one that is there, which comes back when there is no new one."""
    place = locate(layout, lock).path
    aside = place.with_name(f".{place.name}.damaged")
    if at(place) is None and aside.exists():
        shutil.rmtree(place, ignore_errors=True)  # a rebuild was killed: the moved folder is the better one
    else:
        shutil.rmtree(aside, ignore_errors=True)
        if place.exists():
            place.rename(aside)  # a folder, into a free place: no file is replaced
    built, problems = build(layout, lock, BUILD_SECONDS, again=True)
    if built is None and aside.exists():
        shutil.rmtree(place, ignore_errors=True)
        aside.rename(place)
    shutil.rmtree(aside, ignore_errors=True)
    return built, problems


def _restarted(layout: Layout, done: RepairOutcome) -> RepairOutcome:
    if is_marked(layout):
        return done.because("rebuild.stopped", "a person has stopped the endpoint, so it is not started")
    if running(layout) is not None:
        if problem := start_stop.obstacle(layout):
            return done.because("rebuild.not-started", _words([problem]), verdict=RepairVerdict.FAILED)
        start_stop.stop(layout)
    process, problem = start_stop.start(layout)
    if process is None:
        return done.because("rebuild.not-started", _words([problem] if problem else []), verdict=RepairVerdict.FAILED)
    return done.because("rebuild.started", "the endpoint runs from it")


def _words(found: "list[Diagnostic] | tuple[Diagnostic, ...]") -> str:
    """The first error in one line, with the first line of its detail."""
    first = next((item for item in found if item.severity == "error"), found[0] if found else None)
    if first is None:
        return "no reason was given"
    return ": ".join(filter(None, (first.summary, (first.detail or "").partition("\n")[0])))
