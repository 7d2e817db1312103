"""Views of service install and uninstall: the unit first, then the question, then what was done."""

import sys

from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.process.record import Running
from octoform.engine.service import Unit
from octoform.views.format.console import Console
from octoform.views.format.values import escape


def unit(console: Console, found: Unit) -> None:
    """The units as they would stand on the disk."""
    for path, text in ((found.path, found.text), (found.watch.path, found.watch.text)):
        console.line(f"{path}:\n")
        for line in text.splitlines():
            console.raw(f"  {escape(line)}".rstrip())
        console.line()


def machine_wide(console: Console, found: Unit) -> int:
    """Nothing was written; what a person would do who wants it for the whole machine."""
    console.line("Nothing was written. For the whole machine, put these texts at the places above as root, then:")
    console.raw(f"  systemctl daemon-reload\n  systemctl enable --now {found.name} {found.watch.name}")
    return 0


def no_machine_wide(console: Console, found: Unit) -> int:
    """Nothing was taken away; what a person would do."""
    console.line("Nothing was taken away. For the whole machine, as root:")
    console.raw(f"  systemctl disable --now {found.watch.name} {found.name}")
    console.line(f"  rm {found.watch.path} {found.path}\n  systemctl daemon-reload")
    return 0


def for_whom(verb: str) -> Diagnostic:
    """Neither of the two ways was chosen, so nothing was done."""
    hint = (
        f"octoform service {verb} -user does it for this user's systemd; "
        "-print shows the units for the whole machine and what to do with them as root"
    )
    return error("SERVICE-FOR-WHOM", f"nothing was done: service {verb} needs -user or -print", hint=hint)


def approves(console: Console, question: str) -> bool:
    """Ask on the terminal; only ``yes`` is yes."""
    console.line(f"{question} Only 'yes' will be accepted to approve.")
    console.out.write("  Enter a value: ")
    console.out.flush()
    try:
        answer = sys.stdin.readline() if sys.stdin is not None else ""
    except UnicodeDecodeError:
        answer = ""
    console.line()
    return answer.strip() == "yes"


def not_approved() -> Diagnostic:
    """The person did not say yes."""
    hint = "answer yes, or give -auto-approve where nobody can be asked"
    return error("SERVICE-NOT-APPROVED", "nothing was changed: it was not approved", hint=hint)


def installed(console: Console, found: Unit, process: Running) -> int:
    """It runs, and how it would run without a session too."""
    console.line(f"{found.name}: the endpoint of {found.layout.host} runs under systemd (process {process.pid})")
    console.line(f"{found.watch.name}: its daemon does; journalctl --user -u {found.watch.name} shows what it does")
    console.line("To have it run while you are not logged in, once:")
    console.raw(f"  loginctl enable-linger {found.account}")
    return 0


def uninstalled(console: Console, found: Unit, *, was: bool) -> int:
    """It is gone."""
    told = "was stopped and taken away" if was else "was not installed"
    console.line(f"{found.name} {told}")
    return 0
