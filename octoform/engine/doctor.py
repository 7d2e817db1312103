"""``doctor``: is everything there that the manifest needs? It looks, asks and starts, and changes nothing.

Agents that are the same in program, settings and model are looked at once, whatever the number of their stages.
"""

import importlib.metadata
import os
import shlex
import shutil
import sys
import sysconfig
from collections.abc import Callable, Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory

from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.environment.lockfile import packages, reason
from octoform.endpoint.environment.system_programs import missing_programs
from octoform.endpoint.published_files import served_nodes
from octoform.engine.inspect.devices import lacking
from octoform.engine.plan.configuration import MANIFEST
from octoform.harness import adapters, installer, logins, port
from octoform.harness import program_location as installed
from octoform.harness.adapters.command import CommandHarness
from octoform.harness.adapters.program import ProgramHarness
from octoform.harness.doctor_checks import (
    Check,
    Status,
    command_check,
    failed,
    model_checks,
    passed,
    program_checks,
    sandbox_check,
    unknown,
)
from octoform.harness.installer import Setup
from octoform.harness.llm.route import Route, access, apis_for, route
from octoform.harness.llm.token_prices import OWNERS, price_of
from octoform.manifest.loader import load
from octoform.manifest.model import MODEL_FREE, HarnessSpec, Manifest
from octoform.manifest.references import resolve
from octoform.patterns import regex
from octoform.records import dataclass, field
from octoform.state.layout import Layout

LITELLM = "litellm"


@dataclass(frozen=True, slots=True)
class Agent:
    """One agent of the manifest: its harness, its model (reference unresolved), and whether dollars are counted."""

    harness: HarnessSpec
    model: str | None
    money: bool


@dataclass(frozen=True, slots=True)
class Group:
    """The checks of one agent and what it is used for (``probe``, ``identify escalation``, ``housekeeping``)."""

    harness: str
    model: str | None
    used_for: tuple[str, ...]
    checks: tuple[Check, ...]


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """All groups, the checks of the machine, and what is wrong with the manifest, in which case there are no checks."""

    host: str
    groups: tuple[Group, ...] = ()
    machine: tuple[Check, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()

    @property
    def checks(self) -> tuple[Check, ...]:
        """Every check."""
        return (*self.machine, *(check for group in self.groups for check in group.checks))

    @property
    def ok(self) -> bool:
        """True when nothing that is needed failed; an unknown is not a failure."""
        return all(check.status is not Status.FAIL for check in self.checks)


def diagnose(project: Path, environ: Mapping[str, str]) -> Diagnosis:
    """Look at all that the project's manifest needs; at most some ten seconds for each of its agents."""
    manifest, found = load(project / MANIFEST, environ)
    if manifest is None:
        return Diagnosis("", diagnostics=tuple(found))
    rounds = _Checks(manifest, environ)
    groups = tuple(
        Group(agent.harness.name, agent.model, tuple(uses), tuple(rounds.checks(agent)))
        for agent, uses in _agents(manifest).items()
    )
    machine = (
        _git(manifest, environ),
        *_tunnel(manifest, environ),
        *_rights(manifest, environ),
        *_programs(manifest, environ),
    )
    return Diagnosis(manifest.host, groups, machine, tuple(found))


def _programs(manifest: Manifest, environ: Mapping[str, str]) -> tuple[Check, ...]:
    """The programs of the system that the accepted server starts and that are not here."""
    missing = missing_programs(Layout(manifest.project, manifest.host), environ)
    return tuple(
        unknown("program", f"{program} is not on this host, so these tools are not served: {', '.join(sorted(tools))}")
        for program, tools in missing.items()
    )


def _agents(manifest: Manifest) -> dict[Agent, list[str]]:
    """Every agent of the manifest with its uses, in the order of the stages; those of the daemon come after them."""
    found: dict[Agent, list[str]] = {}
    for stage, settings in manifest.stages.items():
        money = settings.budget.usd is not None or manifest.run_usd is not None
        found.setdefault(Agent(settings.harness, settings.model, money), []).append(stage)
        if settings.escalate is not None:
            agent = Agent(settings.escalate.harness, settings.escalate.model, money)
            found.setdefault(agent, []).append(f"{stage} escalation")
    for name, settings in manifest.keepers.items():
        agent = Agent(settings.harness, settings.model, settings.budget.usd is not None or manifest.run_usd is not None)
        if agent in found or settings.harness.name not in MODEL_FREE:  # what comes with octoform needs no check
            found.setdefault(agent, []).append(name)
    keeper = manifest.housekeeping
    if keeper is not None:
        spec = HarnessSpec(LITELLM, key=keeper.key, base_url=keeper.base_url)
        found.setdefault(Agent(spec, keeper.model, manifest.run_usd is not None), []).append("housekeeping")
    return found


@dataclass(slots=True)
class _Checks:
    """The checks over all agents; a program and an API that several of them share are looked at once."""

    manifest: Manifest
    environ: Mapping[str, str]
    seen: dict[object, tuple[Check, ...]] = field(default_factory=dict)

    def checks(self, agent: Agent) -> Iterable[Check]:
        spec = agent.harness
        if spec.name == LITELLM:
            yield _litellm()
            yield from self._sandbox(spec)
            yield from self._litellm_model(agent)
            return
        harness = adapters.resolve(spec, self.environ, self.manifest.project)
        if isinstance(harness, Diagnostic):
            yield failed(_subject(spec), harness.summary, harness.hint)
            return
        yield from self._program(spec, harness)
        yield from self._sandbox(spec)
        if isinstance(harness, ProgramHarness):
            yield from self._model(agent, harness.adapter.apis)

    def _program(self, spec: HarnessSpec, harness: port.Harness) -> tuple[Check, ...]:
        if isinstance(harness, ProgramHarness):
            key = (spec.name, spec.command)
            if key not in self.seen:
                self.seen[key] = program_checks(harness, self.environ)
            return self.seen[key]
        if isinstance(harness, CommandHarness):
            return (command_check(harness.argv[0], self.environ),)
        # What was resolved and needs no program: the embedded agent, or a recording that has been read.
        detail = f"{spec.recording} can be played" if spec.recording is not None else "comes with octoform"
        return (passed(_subject(spec), detail),)

    def _sandbox(self, spec: HarnessSpec) -> tuple[Check, ...]:
        if spec.name in MODEL_FREE:
            return ()
        key = ("sandbox", spec.sandbox)
        if key not in self.seen:
            self.seen[key] = (sandbox_check(spec.sandbox, self.environ),)
        return self.seen[key]

    def _litellm_model(self, agent: Agent) -> Iterable[Check]:
        name = self._name(agent)
        way = route(agent.harness, name, self.environ)
        if isinstance(way, Route) and way.base_url is None:
            yield unknown("model API", f"{agent.model} is of a provider that litellm may know; octoform does not")
            yield from self._price(agent, name)
        else:
            yield from self._model(agent, apis_for(name))

    def _name(self, agent: Agent) -> str | None:
        """The model with its references replaced."""
        return resolve(agent.model, self.environ) if agent.model is not None else None

    def _model(self, agent: Agent, apis: tuple[str, ...]) -> Iterable[Check]:
        name = self._name(agent)
        way = access(agent.harness, name, apis, self.environ)
        if isinstance(way, Diagnostic):
            yield failed("model", way.summary, way.hint)
            return
        if agent.harness.login:
            yield from self._login(agent.harness)
            yield from self._price(agent, name)
            return
        key = (way, agent.harness.key, agent.harness.env)
        if key not in self.seen:
            self.seen[key] = tuple(model_checks(way, agent.harness.key, self.environ, agent.harness.env))
        yield from self.seen[key]
        yield from self._price(agent, name)

    def _login(self, spec: HarnessSpec) -> Iterable[Check]:
        """A subscription's service is asked by its own program alone."""
        found = logins.find(spec, self.environ)
        if isinstance(found, Diagnostic):
            yield failed("login", found.summary, found.hint)
        else:
            ends = f", until {_moment(found.until)}" if found.until is not None else ""
            yield passed("login", f"yours with {spec.name}, from {found.place}{ends}")
        yield unknown("model API", f"only {spec.name} itself asks it with a login")

    def _price(self, agent: Agent, name: str | None) -> tuple[Check, ...]:
        """Whether its price is known, where dollars are counted."""
        if not agent.money or name is None:
            return ()
        listed = self.manifest.prices.get(agent.model or "")
        known = {name: port.Price(listed.input, listed.cached, listed.output, OWNERS)} if listed else {}
        price = price_of(name, known)
        if price is None:
            hint = (
                f"prices: {{{agent.model}: {{input: ..., output: ...}}}} in octopus.yaml, dollars for a million tokens"
            )
            return (failed("price", f"budget.usd is set, and no one knows what {agent.model} costs", hint),)
        whose = "octopus.yaml" if price.source == "manifest" else price.source
        return (passed("price", f"{price.input:g} and {price.output:g} dollars for a million tokens, by {whose}"),)


def _moment(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M UTC")


def _subject(spec: HarnessSpec) -> str:
    return "recording" if spec.recording is not None else "harness"


def _litellm() -> Check:
    try:
        return passed("program", f"litellm {importlib.metadata.version(LITELLM)} beside octoform")
    except importlib.metadata.PackageNotFoundError:
        return failed("program", "the Python package litellm is not installed", "octoform install litellm")


def _git(manifest: Manifest, environ: Mapping[str, str]) -> Check:
    path = shutil.which("git", path=environ.get("PATH"))
    if path is not None:
        return passed("git", path)
    hint = "install git; without it no revision is recorded and nothing is committed"
    return (failed if manifest.git.commit else unknown)("git", "there is no git on PATH", hint)


def _rights(manifest: Manifest, environ: Mapping[str, str]) -> tuple[Check, ...]:
    """Whether this user may use the devices of the endpoint; nothing to check before there is one."""
    layout = Layout(manifest.project, manifest.host)
    count = len(served_nodes(layout))
    if not count:
        return ()
    shut = lacking(layout, environ)
    closed = tuple(failed("rights", f"{name}: {why}") for name, why in sorted(shut.items()))
    return closed or (passed("rights", f"this user may use all {count} devices of the endpoint"),)


def _tunnel(manifest: Manifest, environ: Mapping[str, str]) -> tuple[Check, ...]:
    """The program of the tunnel, which is only found missing once the endpoint runs."""
    if manifest.tunnel is None:
        return ()
    program = manifest.tunnel.command[0]
    path = shutil.which(program, path=environ.get("PATH"))
    if path is not None:
        return (passed("tunnel", path),)
    hint = "install it, or name another as tunnel.command; until then the endpoint is not reached from the internet"
    return (failed("tunnel", f"there is no program {program!r}", hint),)


# ``install``: the programs of harnesses, in the versions that octoform was tried with.
#
# Most are npm packages and go into a cache folder of the user; ``litellm`` is a Python package and goes into octoform's
# own environment, where that is one that may be changed.

NOTHING = {
    "builtin": "it comes with octoform",
    "command": "it runs a program of your own",
    "replay": "it reads a recorded run",
}
SECONDS = 900.0
_EXTRA = regex(r"""^([^;]+);\s*extra\s*==\s*['"]litellm['"]\s*$""")


@dataclass(frozen=True, slots=True)
class Installed:
    """One harness that can be used; ``state`` is ``installed``, ``present`` (was there) or ``nothing`` (to install)."""

    harness: str
    state: str
    detail: str
    version: str | None = None
    program: str | None = None
    node: str | None = None


@dataclass(frozen=True, slots=True)
class InstallResult:
    """The installed programs, and those that could not be installed."""

    installed: tuple[Installed, ...]
    diagnostics: tuple[Diagnostic, ...]


def install(names: Iterable[str], environ: Mapping[str, str], report: Callable[[str], None]) -> InstallResult:
    """Install each by its name of the manifest; one that fails does not keep the others back."""
    found = [_one(name, environ, report) for name in dict.fromkeys(names)]
    return InstallResult(
        tuple(item for item in found if isinstance(item, Installed)),
        tuple(item for item in found if isinstance(item, Diagnostic)),
    )


def _one(name: str, environ: Mapping[str, str], report: Callable[[str], None]) -> Installed | Diagnostic:
    if name in NOTHING:
        return Installed(name, "nothing", NOTHING[name])
    if name == LITELLM:
        return _install_litellm(lambda text: report(f"{name}: {text}"))
    harness = adapters.resolve(HarnessSpec(name), environ)
    if isinstance(harness, Diagnostic):
        return harness
    if not isinstance(harness, ProgramHarness):
        return Installed(name, "nothing", "it needs no program")
    setup = Setup(installed.folder(environ), environ, _fetch, lambda text: report(f"{name}: {text}"))
    done = installer.install(harness.adapter.pin, setup)
    if isinstance(done, Diagnostic):
        return done
    state = "installed" if done.is_new else "present"
    return Installed(name, state, str(done.home), done.pin.version, str(done.program), done.node)


def _fetch(requirement: str, target: Path) -> str | None:
    """One wheel into a folder, from the package cache first; see `slots.Fetch`."""
    arguments = ["pip", "install", "--quiet", "--no-deps", "--only-binary", ":all:", "--python", sys.executable]
    arguments += ["--target", str(target), requirement]
    return _uv(arguments, target)


def _uv(arguments: list[str], folder: Path) -> str | None:
    try:
        done = packages([*arguments, "--offline"], folder, SECONDS)
        if done.status != 0:
            done = packages(arguments, folder, SECONDS)
    except FileNotFoundError:
        return "the package tool uv is not installed beside octoform"
    return None if done.status == 0 else reason(done)


def _install_litellm(report: Callable[[str], None]) -> Installed | Diagnostic:
    """The package that octoform's own extra names."""
    version = _version(LITELLM)
    if version is not None:
        return Installed(LITELLM, "present", sys.prefix, version)
    requirement = _requirement()
    command = ["uv", "pip", "install", "--python", sys.executable, requirement]
    foreign = elsewhere(Path(sys.prefix), requirement)
    if foreign is not None:
        summary = f"litellm belongs in octoform's own environment, {sys.prefix}, which is not octoform's to change"
        return error("HARNESS-INSTALL-FOREIGN", summary, hint=f"run: {foreign}")
    report(f"installing {requirement} into {sys.prefix}")
    with TemporaryDirectory(prefix="octoform-install-") as folder:
        problem = _uv([*command[1:3], "--quiet", *command[3:]], Path(folder))
    if problem is not None:
        summary = f"{requirement} could not be installed"
        return error("HARNESS-INSTALL-FAILED", summary, detail=problem, hint=f"or run yourself: {shlex.join(command)}")
    importlib.invalidate_caches()
    return Installed(LITELLM, "installed", sys.prefix, _version(LITELLM))


def elsewhere(prefix: Path, requirement: str) -> str | None:
    """The command for a person where this environment belongs to another tool or user; None when it may be changed."""
    quoted = shlex.quote(requirement)
    if (prefix / "uv-receipt.toml").exists():
        return f"uv tool install --with {quoted} octoform"
    if (prefix / "pipx_metadata.json").exists():
        return f"pipx inject octoform {quoted}"
    if sys.prefix == sys.base_prefix or not os.access(sysconfig.get_path("purelib"), os.W_OK):
        return f"{shlex.quote(sys.executable)} -m pip install {quoted}"
    return None


def _requirement() -> str:
    """The requirements of octoform's own extra."""
    found = (_EXTRA.match(line) for line in importlib.metadata.requires("octoform") or ())
    return next((item[1].strip() for item in found if item), LITELLM)


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None
