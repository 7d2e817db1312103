"""Rules for DEPLOY: a dependency set that is exact, complete and owns up to what failed.

What runs beside the hardware for months is decided here once, so nothing may be left to whatever version a package
index happens to offer on the day of a repair. Light.
"""

from collections.abc import Collection, Mapping

from octoform.base.escaping import display, escaped, listed
from octoform.base.shape import pointer
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.name_words import is_misspelt
from octoform.contracts.rules.serve.code_rules import is_standard, programs_of
from octoform.contracts.rules.text_rules import in_values
from octoform.contracts.server_code.script_header import (
    declared_names,
    declared_requirements,
    normalised,
    required_python,
)
from octoform.contracts.server_code.server_source import Source, imported_modules, read_source
from octoform.diagnostics import Diagnostic, error, warning

_BUILDS = frozenset({"headless", "contrib", "gpu", "cpu", "full", "lite", "nogui"})
"""Words by which builds of one library are distinguished in its name."""
_PYTHONS = tuple(f"3.{minor}.{patch}" for minor in range(8, 30) for patch in (0, 9))


def status_error(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A DEPLOY that reports failure has failed."""
    if value["status"] == "ok":
        text = value.get("error", "").strip()
        hint = (
            "write status error where something is wrong; else leave `error` out (what was chosen goes to `conflicts`)"
        )
        summary = f"DEPLOY reports success and an error at once: {escaped(text[:300])}"
        return [error("DEPLOY-STATUS-ERROR", summary, pointer="/error", hint=hint)] if text else []
    reason = value.get("error", "").strip()
    summary = f"DEPLOY reports failure: {escaped(reason[:300])}" if reason else "DEPLOY reports failure and no reason"
    failed = [f"{item['name']}: {item['reason']}" for item in value.get("deps_failed", ())]
    detail = "\n".join(escaped(line) for line in failed[:10]) or None
    return [error("DEPLOY-STATUS-ERROR", summary, pointer="/status", detail=detail)]


def import_unresolved(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Each import of the server is listed, and each third-party one has a provider.

    A module that is imported only inside functions may be provided by a dependency that failed: then its tools fail
    when they are called, and the others work.
    """
    provided = {item["module"].partition(".")[0]: item["provided_by"] for item in value["imports"]}
    failed = {normalised(item["name"]) for item in value.get("deps_failed", ())}
    out = []
    for module, inside in _foreign_imports(artifacts).items():
        if module not in provided:
            summary = f"server.py imports {display(module)}, and imports names nothing that provides it"
            hint = "add it to imports with the requirement that provides it"
        elif normalised(provided[module]) in failed and not inside:
            summary = (
                f"server.py imports {display(module)} at its top, but {display(provided[module])} failed to install"
            )
            hint = "find a version that installs; only an import inside a function can do without"
        else:
            continue
        out.append(error("DEPLOY-IMPORT-UNRESOLVED", summary, pointer="/imports", hint=hint))
    for module in sorted(_own_imports(artifacts) - provided.keys()):
        provider = "runtime" if module == "runtime" else "python"
        summary = f"server.py imports {display(module)}, which `imports` does not list"
        hint = f"add it, provided by `{provider}`"
        out.append(error("DEPLOY-IMPORT-UNRESOLVED", summary, pointer="/imports", hint=hint))
    return out


def import_provider(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A provider is a listed requirement, or ``python`` or ``runtime`` where that is true."""
    names = {normalised(item["name"]) for item in value["requirements"]}
    names |= {normalised(item["name"]) for item in value.get("deps_failed", ())}
    out = []
    for index, item in enumerate(value["imports"]):
        module, provider = item["module"].partition(".")[0], item["provided_by"]
        own = "runtime" if module == "runtime" else "python" if is_standard(module) else None
        if own not in (None, provider) and module in _own_imports(artifacts):
            there = "lies beside the server" if own == "runtime" else "is a part of Python"
            summary = f"{display(item['module'])} {there}, and {display(provider)} does not provide it"
            where = pointer("imports", index, "provided_by")
            out.append(error("DEPLOY-IMPORT-PROVIDER", summary, pointer=where, hint=f"write `{own}`"))
            continue
        if provider == "python":
            fits = is_standard(module)
        elif provider == "runtime":
            fits = module == "runtime"
        else:
            fits = normalised(provider) in names
        if not fits:
            summary = (
                f"{display(item['module'])} is declared to come from {display(provider)}, which does not provide it"
            )
            hint = "name one of requirements; `python` is the standard library, `runtime` only the module runtime"
            where = pointer("imports", index, "provided_by")
            out.append(error("DEPLOY-IMPORT-PROVIDER", summary, pointer=where, hint=hint))
    return out


def provider_twice(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """One package provides a module; two that have the same module overwrite each other."""
    first: dict[str, str] = {}
    out = []
    for index, item in enumerate(value["imports"]):
        module, provider = item["module"].partition(".")[0], normalised(item["provided_by"])
        if first.setdefault(module, provider) != provider:
            summary = (
                f"{display(module)} is declared to come from {display(first[module])} and from {display(provider)}"
            )
            where = pointer("imports", index, "provided_by")
            hint = "require the one whose build has what the server calls, and leave the other out"
            out.append(error("DEPLOY-PROVIDER-TWICE", summary, pointer=where, hint=hint))
    return out + _builds_twice(value) + _named_as_module(value)


def version_outside(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """An exact version lies within the range that the server's header gives for it."""
    from packaging.requirements import Requirement
    from packaging.version import InvalidVersion, Version

    written = declared_requirements(artifacts.serve or "")
    ranges = {normalised(item.name): (item.specifier, text) for text in written for item in [Requirement(text)]}
    out = []
    for index, item in enumerate(value["requirements"]):
        if normalised(item["name"]) not in ranges:
            continue
        specifier, text = ranges[normalised(item["name"])]
        try:
            fits = specifier.contains(Version(item["version"]), prereleases=True)
        except InvalidVersion:
            fits = False
        if not fits:
            summary = (
                f"{display(item['name'])} {display(item['version'])} is outside of the header's range {display(text)}"
            )
            hint = "take a version within the range; if none works, report that in `error` for the next SERVE"
            where = pointer("requirements", index, "version")
            out.append(error("DEPLOY-VERSION-OUTSIDE", summary, pointer=where, hint=hint))
    return out


def version_local(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A version is one that an index offers to everybody, and of no build that one machine has."""
    return [
        error(
            "DEPLOY-VERSION-LOCAL",
            f"{display(name)} {display(text)} is a local build, which no index offers to others",
            pointer=pointer("requirements", index, "version"),
            hint=f"take the public version: {text.partition('+')[0]}",
        )
        for index, name, text in _versions(value)
        if "+" in text
    ]


def version_early(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A version is a finished release."""
    from packaging.version import InvalidVersion, Version

    out = []
    for index, name, text in _versions(value):
        try:
            early = Version(text).is_prerelease and "+" not in text
        except InvalidVersion:
            continue  # outside of every range
        if early:
            summary = f"{display(name)} {display(text)} is no finished release"
            hint = "take a finished release; if only this one works, state that in `why`"
            where = pointer("requirements", index, "version")
            out.append(warning("DEPLOY-VERSION-EARLY", summary, pointer=where, hint=hint))
    return out


def python_outside(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """`python` is a range, and has a version in common with what the server's header asks for."""
    from packaging.specifiers import InvalidSpecifier, SpecifierSet

    if "python" not in value:
        return []
    hint = "write a version specifier that the server's header allows, such as >=3.11"
    try:
        wanted = SpecifierSet(value["python"])
        given = SpecifierSet(required_python(artifacts.serve or ""))
    except InvalidSpecifier:
        summary = f"{display(value['python'])} is no range of Python versions"
        return [error("DEPLOY-PYTHON-OUTSIDE", summary, pointer="/python", hint=hint)]
    if artifacts.python and not wanted.contains(artifacts.python, prereleases=True):
        summary = f"{display(value['python'])} does not hold Python {artifacts.python}, which will serve"
        hint = f"write a range that includes Python {artifacts.python}: it runs the server"
        return [error("DEPLOY-PYTHON-OUTSIDE", summary, pointer="/python", hint=hint)]
    if any(each in wanted and each in given for each in _PYTHONS):
        return []
    summary = f"no version of Python is both {display(value['python'])} and {display(str(given))}, as the server asks"
    return [error("DEPLOY-PYTHON-OUTSIDE", summary, pointer="/python", hint=hint)]


def failed_unknown(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A requirement that is reported as failed must be one of the server's."""
    known = declared_names(artifacts.serve or "") | {normalised(item["provided_by"]) for item in value["imports"]}
    return [
        warning(
            "DEPLOY-FAILED-UNKNOWN",
            f"{display(item['name'])} is reported as failed, and the server asks for no such package",
            pointer=pointer("deps_failed", index, "name"),
            hint="name the package as the server's header does, or take it out",
        )
        for index, item in enumerate(value.get("deps_failed", ()))
        if artifacts.serve is not None and normalised(item["name"]) not in known
    ]


def import_not_there(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """The modules of other packages that are listed are those that the server imports."""
    if artifacts.serve is None:
        return []
    imported = _foreign_imports(artifacts)
    out = []
    for index, item in enumerate(value["imports"]):
        module = item["module"].partition(".")[0]
        if item["provided_by"] in ("python", "runtime") or module in imported or module in _own_imports(artifacts):
            continue
        summary = f"server.py does not import {display(item['module'])}"
        hint = "list what the server imports, and require nothing for the rest"
        out.append(error("DEPLOY-IMPORT-NOT-THERE", summary, pointer=pointer("imports", index), hint=hint))
    return out


def duplicate_requirement(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A requirement stands once, with one version."""
    first: dict[str, int] = {}
    out = []
    for index, item in enumerate(value["requirements"]):
        before = first.setdefault(normalised(item["name"]), index)
        if before != index:
            summary = f"{display(item['name'])} is required twice, first at requirements[{before}]"
            where = pointer("requirements", index, "name")
            out.append(error("DEPLOY-DUPLICATE-REQUIREMENT", summary, pointer=where, hint="keep one exact version"))
    return out


def failed_and_required(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A requirement that failed to install must not be listed as required too."""
    names = {normalised(item["name"]) for item in value["requirements"]}
    return [
        error(
            "DEPLOY-FAILED-AND-REQUIRED",
            f"{display(item['name'])} failed to install and is a requirement",
            pointer=pointer("deps_failed", index, "name"),
            hint="a requirement must install; take it out of one of the two lists",
        )
        for index, item in enumerate(value.get("deps_failed", ()))
        if normalised(item["name"]) in names
    ]


def declared_not_required(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Each requirement of the server's header must be listed as required or as failed."""
    settled = {normalised(item["name"]) for item in (*value["requirements"], *value.get("deps_failed", ()))}
    return [
        error(
            "DEPLOY-DECLARED-NOT-REQUIRED",
            f"server.py declares {display(name)}, which is neither required nor reported as failed",
            pointer="/requirements",
            hint="add it to requirements with an exact version",
        )
        for name in sorted(declared_names(artifacts.serve or "") - settled)
    ]


_INSTALLERS = frozenset({"pip", "setuptools", "wheel", "uv", "virtualenv", "pipenv", "poetry", "build", "hatch", "pdm"})
"""Package installers; nothing that runs in it needs them unless it imports them."""


def requirement_unused(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A requirement provides an import or states its purpose, and is not spelt almost as one that is used.

    The name of a module is no purpose: it states an import, and the server has none of it.
    """
    used = {normalised(each["provided_by"]) for each in value["imports"]}
    declared = declared_names(artifacts.serve or "")
    out = []
    for index, item in enumerate(value["requirements"]):
        name, why = normalised(item["name"]), item.get("why", "").strip()
        alike = sorted(each for each in used | declared if name not in used | declared and is_misspelt(name, each))
        a_module = why.replace(".", "_").isidentifier() and name not in declared
        if name not in used and (name in _INSTALLERS or not why or a_module):
            what = "provides no import and gives no reason why it is required"
            hint = "take it out, or write its purpose into `why`"
        elif alike:
            what = f"provides no import and is spelt almost as {display(alike[0])} is"
            hint = f"take it out; only {display(alike[0])} is used"
        else:
            continue
        summary, where = f"{display(item['name'])} {what}", pointer("requirements", index)
        out.append(error("DEPLOY-REQUIREMENT-UNUSED", summary, pointer=where, hint=hint))
    return out


def program_unlisted(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Where programs are listed, they are those that the server starts."""
    if artifacts.serve is None or "programs" not in value:
        return []
    if not isinstance(read_source(artifacts.serve), Source):
        return []
    started = programs_of(artifacts.serve)
    listed = [item["name"] for item in value["programs"]]
    out = [
        error(
            "DEPLOY-PROGRAMS-DIFFER",
            f"server.py does not start {display(name)}",
            pointer=pointer("programs", index, "name"),
            hint="list the programs that are first in its lists for subprocess, spelt as there",
        )
        for index, name in enumerate(listed)
        if name not in started
    ]
    if absent := sorted(started - {*listed}):
        summary = f"server.py starts {', '.join(map(display, absent))}, which `programs` does not list"
        hint = "add it with the package of this system that has it"
        out.append(error("DEPLOY-PROGRAMS-DIFFER", summary, pointer="/programs", hint=hint))
    return out


RULES = (
    Rule("DEPLOY-PROGRAMS-DIFFER", program_unlisted),
    Rule("DEPLOY-STATUS-ERROR", status_error),
    Rule("DEPLOY-IMPORT-UNRESOLVED", import_unresolved),
    Rule("DEPLOY-IMPORT-PROVIDER", import_provider),
    Rule("DEPLOY-PROVIDER-TWICE", provider_twice),
    Rule("DEPLOY-VERSION-OUTSIDE", version_outside),
    Rule("DEPLOY-VERSION-LOCAL", version_local),
    Rule("DEPLOY-VERSION-EARLY", version_early),
    Rule("DEPLOY-PYTHON-OUTSIDE", python_outside),
    Rule("DEPLOY-FAILED-UNKNOWN", failed_unknown),
    Rule("DEPLOY-IMPORT-NOT-THERE", import_not_there),
    Rule("DEPLOY-DUPLICATE-REQUIREMENT", duplicate_requirement),
    Rule("DEPLOY-FAILED-AND-REQUIRED", failed_and_required),
    Rule("DEPLOY-DECLARED-NOT-REQUIRED", declared_not_required),
    Rule("DEPLOY-REQUIREMENT-UNUSED", requirement_unused),
    Rule("DEPLOY-UNESCAPED-TEXT", in_values("DEPLOY-UNESCAPED-TEXT")),
)


def _foreign_imports(artifacts: Artifacts) -> dict[str, bool]:
    """Third-party top-level module to whether every import of it is inside a function."""
    source = read_source(artifacts.serve or "")
    out: dict[str, bool] = {}
    if isinstance(source, Source):
        for name, _, inside in imported_modules(source):
            if name not in ("runtime", ".") and not is_standard(name):
                out[name] = out.get(name, True) and inside
    return out


def _own_imports(artifacts: Artifacts) -> set[str]:
    """What the server imports of the standard library, and ``runtime`` where it does."""
    source = read_source(artifacts.serve or "")
    names = {name for name, _, _ in imported_modules(source)} if isinstance(source, Source) else set()
    return {name for name in names if name != "__future__" and (name == "runtime" or is_standard(name))}


def _named_as_module(value: JsonObject) -> list[Diagnostic]:
    """A package that is required for a module which another one is stated to provide."""
    providers = {item["module"]: item["provided_by"] for item in value["imports"]}
    out = []
    for index, item in enumerate(value["requirements"]):
        module = item.get("why", "").strip()
        other = providers.get(module)
        if other is not None and normalised(other) != normalised(item["name"]):
            summary = f"{display(item['name'])} is required for {display(module)}, which {display(other)} provides"
            hint = "require the one package that provides the module, and leave the other out"
            where = pointer("requirements", index, "name")
            out.append(error("DEPLOY-PROVIDER-TWICE", summary, pointer=where, hint=hint))
    return out


def _builds_twice(value: JsonObject) -> list[Diagnostic]:
    """Two builds of one library have the same modules, and the one that is installed last wins."""
    names = [(index, set(normalised(item["name"]).split("-"))) for index, item in enumerate(value["requirements"])]
    out = []
    for index, words in names:
        for other, fewer in names:
            if index != other and words > fewer and words - fewer <= _BUILDS:
                one, two = (display(value["requirements"][at]["name"]) for at in (index, other))
                summary = f"{one} and {two} are two builds of one library and overwrite each other"
                hint = "require the one whose build has what the server calls, and leave the other out"
                where = pointer("requirements", index, "name")
                out.append(error("DEPLOY-PROVIDER-TWICE", summary, pointer=where, hint=hint))
    return out


def _versions(value: JsonObject) -> list[tuple[int, str, str]]:
    return [(index, item["name"], item["version"]) for index, item in enumerate(value["requirements"])]


def deploy_installed(
    deploy: JsonObject,
    server: str,
    providers: Mapping[str, Collection[str]],
    requirements: Mapping[str, Collection[str]],
) -> list[Diagnostic]:
    """Diagnostics for a DEPLOY artifact by the built environment and the source of a server.

    ``providers`` are the distributions that have files of a module, ``requirements`` what each installed one asks for.
    """
    out = []
    named = {normalised(item["name"]) for item in deploy["requirements"]}
    failed = {normalised(item["name"]) for item in deploy.get("deps_failed", ())}
    # A declared package without an import needs a stated reason; what another one needs was pinned on purpose.
    used = declared_names(server) | {name for wanted in requirements.values() for name in wanted}
    for index, item in enumerate(deploy["imports"]):
        module, provider = item["module"].partition(".")[0], normalised(item["provided_by"])
        real = set(providers.get(module, ()))
        if provider in failed | {"python", "runtime"}:
            continue
        if _provides(provider, real, named, requirements):
            used |= {provider}
            continue
        used |= real
        says = f"; it comes from {listed(sorted(real))}" if real else ", and nothing else that is installed has it"
        summary = f"{display(provider)} is installed and has no module {display(module)}{says}"
        hint = "name the package that has the module, and require that one"
        where = pointer("imports", index, "provided_by")
        out.append(error("DEPLOY-IMPORT-PROVIDER", summary, pointer=where, hint=hint))
    for index, item in enumerate(deploy["requirements"]):
        if normalised(item["name"]) not in used:
            summary = f"{display(item['name'])} has no module that server.py imports, and no other package needs it"
            where = pointer("requirements", index)
            out.append(error("DEPLOY-REQUIREMENT-UNUSED", summary, pointer=where, hint="take it out"))
    return out


def _provides(
    provider: str, real: Collection[str], named: Collection[str], requirements: Mapping[str, Collection[str]]
) -> bool:
    """Whether a package has the module, or brings a package that has it and that is not itself required."""
    if provider in real:
        return True
    if set(real) & set(named):
        return False
    brought, queue = set(), [provider]
    while queue:
        name = queue.pop()
        if name not in brought:
            brought.add(name)
            queue += requirements.get(name, ())
    return bool(brought & set(real))
