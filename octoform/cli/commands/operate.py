"""Commands that operate the endpoint and its daemon: start, stop, restart, watch, heal, pause, resume, service, unlock.

A command imports what it needs when it is chosen: all others cost nothing.
"""

from __future__ import annotations

from octoform.cli.table import HEALTH_CODES, Arguments, Json, flag, operand, option, optional

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable

    from octoform.base.health_status import Status
    from octoform.cli.dispatch import Run
    from octoform.diagnostics import Diagnostic
    from octoform.engine import endpoint_process as engine
    from octoform.views.daemon.event_log import Lines, Objects, Silence


def run_start(_: Json, run: Run) -> int:
    """Exit code 0 when the endpoint runs, no matter who started it."""
    from octoform.engine.endpoint_process import start
    from octoform.views.endpoint import process

    return run.answer(start(*run.here), process.started)


class StopArguments(Json):
    """Of ``stop``."""

    host: str | None = optional("HOST", "another host of this folder, also a former one")


def run_stop(arguments: StopArguments, run: Run) -> int:
    """Exit code 0 when no process of the endpoint is left, and nothing starts another."""
    from octoform.engine.endpoint_process import stop
    from octoform.views.endpoint import process

    done, found = stop(*run.here, arguments.host)
    if done is None:
        return run.show(*found)
    status = run.note(*found)
    process.stopped(run.screen, done, stays=status == 0, as_json=run.as_json)
    return status


def run_restart(_: Json, run: Run) -> int:
    """Exit code 0 when the endpoint runs again."""
    from octoform.engine.endpoint_process import restart
    from octoform.views.endpoint import process

    return run.answer(restart(*run.here), process.started)


class WatchArguments(Json):
    """Of ``watch``."""

    epilog = """\
exit codes:
  128 and the number of the signal that ended it (130 for Ctrl-C); with -once the code of the health that it left:
  0 healthy, 3 degraded, 4 error, 5 down, 6 unknown; 1 for an error, such as a daemon that runs already
"""
    once: bool = flag("run one check cycle with all repairs that are due, then exit")


def run_watch(arguments: WatchArguments, run: Run) -> int:
    """The exit code for the signal that ended it; with ``-once`` the exit codes of ``health``."""
    from octoform.views.daemon.event_log import Lines, Objects

    view = Objects(run.screen) if run.as_json or not run.screen.out.isatty() else Lines(run.screen)
    return _watched(run, view, once=arguments.once)[0]


def _watched(
    run: Run, view: Lines | Objects | Silence, *, once: bool, beside: Callable[[], int | None] = lambda: None
) -> tuple[int, Status | None]:
    """The exit code, and the health that the last check cycle left.

    None where it came to no end of its own: it was refused, which is shown (1), or ended by a signal (128 + number).
    ``beside`` gives the exit code where another process has become the daemon meanwhile; None: that is a refusal, too.
    """
    from octoform.base.health_status import Status
    from octoform.daemon.main import watch
    from octoform.daemon.store.instance_lock import TAKEN
    from octoform.views.daemon.event_log import EXIT

    try:
        done, found = watch(*run.here, view, once)
    finally:
        view.end()
    if done is None and any(each.code == TAKEN for each in found) and (code := beside()) is not None:
        return code, None
    if done is None:
        return run.show(*found), None
    if done.signal is not None:
        return 128 + done.signal, None
    health = done.last.health if done.last is not None else None
    return (1, Status.UNKNOWN) if health is None else (EXIT[health.status], health.status)


class HealArguments(Json):
    """Of ``heal``."""

    epilog = HEALTH_CODES.format(", where no daemon runs and heal makes one check cycle (else 0: the daemon was asked)")
    retry: str | None = option(
        str, "TARGET", "try again to repair TARGET, such as endpoint or tool:move_rail; `all` for everything"
    )


def run_heal(arguments: HealArguments, run: Run) -> int:
    """0 when a daemon was asked; of a check cycle that was made here the exit codes of ``health``."""
    from octoform.daemon.requests import daemon_of, given_up, retry
    from octoform.views.daemon import requests
    from octoform.views.daemon.event_log import Lines, Silence

    known = given_up(run.layout)
    retried, problem = retry(run.layout, known, arguments.retry)
    if problem is not None:
        return run.show(problem)

    def asked() -> int | None:
        """The exit code when a daemon lives: the request is written by now, and it takes that up."""
        daemon = daemon_of(run.layout)
        return None if daemon is None else requests.asked(run.screen, daemon, known, retried, as_json=run.as_json)

    if (code := asked()) is not None:
        return code
    view = Silence() if run.as_json else Lines(run.screen)
    # A daemon may have started since.
    code, status = _watched(run, view, once=True, beside=asked)
    if status is not None:
        requests.healed(run.screen, given_up(run.layout), retried, str(status), as_json=run.as_json)
    return code


def run_pause(_: Json, run: Run) -> int:
    """Exit code 0 when repairs are paused, also where no daemon runs yet."""
    from octoform.daemon.observe.clock_jumps import SystemClock
    from octoform.daemon.store import instance_lock
    from octoform.views.daemon import requests

    if problem := instance_lock.pause(run.layout, SystemClock().stamp()):
        return run.show(problem)
    return requests.paused(run.screen, run.layout.host, instance_lock.alive(run.layout), as_json=run.as_json)


def run_resume(_: Json, run: Run) -> int:
    """Exit code 0 when repairs are not paused any more."""
    from octoform.daemon.store import instance_lock
    from octoform.views.daemon import requests

    was, problem = instance_lock.resume(run.layout)
    if problem is not None:
        return run.show(problem)
    alive = instance_lock.alive(run.layout)
    return requests.resumed(run.screen, run.layout.host, alive, was=was, as_json=run.as_json)


class ServiceArguments(Arguments):
    """Of both verbs of ``service``."""

    exclusive = ("user", "print")
    user: bool = flag("for this user's systemd")
    print: bool = flag("only print the units for the whole machine, and what to do with them as root")
    auto_approve: bool = flag("do not ask")

    def unit(self, run: Run, verb: str) -> engine.Unit | None:
        """The unit that is meant; None where there is none, which is shown."""
        from octoform.engine.endpoint_process import unit_of
        from octoform.views.endpoint.process import for_whom

        wanted = self.user or self.print
        unit, found = unit_of(*run.here, own=self.user) if wanted else (None, [for_whom(verb)])
        if unit is None:
            run.show(*found)
        return unit

    def refusal(self, run: Run, unit: engine.Unit, question: str) -> Diagnostic | None:
        """Why a unit stays as it is: something is in the way, or a person did not say yes."""
        from octoform.engine.endpoint_process import obstacle
        from octoform.views.endpoint.process import approves, not_approved

        problem = obstacle(unit)
        return problem or (None if self.auto_approve or approves(run.screen, question) else not_approved())


def run_service_install(arguments: ServiceArguments, run: Run) -> int:
    """With ``-user`` show the units and do it, after a yes; with ``-print`` show those for the whole machine."""
    from octoform.engine import endpoint_process as engine
    from octoform.views.endpoint import process as view

    if (unit := arguments.unit(run, "install")) is None:
        return 1
    if problem := engine.missing(unit):
        return run.show(problem)
    view.unit(run.screen, unit)
    if not unit.own:
        return view.machine_wide(run.screen, unit)
    question = "Write these units and run the endpoint and its daemon with them?"
    if problem := arguments.refusal(run, unit, question):
        return run.show(problem)
    process, found = engine.install(unit)
    return run.show(*found) if process is None else view.installed(run.screen, unit, process)


def run_service_uninstall(arguments: ServiceArguments, run: Run) -> int:
    """With ``-user`` end both and take the units away, after a yes."""
    from octoform.engine.endpoint_process import uninstall
    from octoform.views.endpoint import process as view

    if (unit := arguments.unit(run, "uninstall")) is None:
        return 1
    if not unit.own:
        return view.no_machine_wide(run.screen, unit)
    if not unit.path.exists() and not unit.watch.path.exists():
        return view.uninstalled(run.screen, unit, was=False)
    question = f"Stop the endpoint and its daemon, and remove {unit.path} and {unit.watch.path}?"
    if problem := arguments.refusal(run, unit, question):
        return run.show(problem)
    was, found = uninstall(unit)
    return run.show(*found) or view.uninstalled(run.screen, unit, was=was)


class UnlockArguments(Arguments):
    """Of ``force-unlock``."""

    lock_id: str = operand(str, "LOCK-ID")


def run_force_unlock(arguments: UnlockArguments, run: Run) -> int:
    """Needs the lock's id, which a refused run has printed."""
    from octoform.engine.inspect.state import unlock
    from octoform.views import state

    return run.show(*unlock(*run.here, arguments.lock_id)) or state.unlocked(run.screen, arguments.lock_id)
