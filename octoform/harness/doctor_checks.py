"""The result of a check of an agent's surroundings, and the checks of its program: there, the tried version, its node.

A check that could not be carried out, or whose answer proves nothing, is ``unknown``, which is not ``pass``.
"""

import http.client
import shutil
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import octoform
from octoform.base import shortage
from octoform.base.files import parse
from octoform.diagnostics import UNTRUSTED_CERTIFICATE, did_you_mean, is_untrusted_certificate
from octoform.harness.adapters.program import ProgramHarness
from octoform.harness.containment import sandbox
from octoform.harness.installer import at_least, dotted, node_version
from octoform.harness.llm.route import Access
from octoform.harness.program_location import Located, Pin
from octoform.harness.short_command import stated_version
from octoform.manifest.credentials import ANTHROPIC, GEMINI, is_sendable
from octoform.manifest.model import Sandbox
from octoform.manifest.model_url import is_loopback
from octoform.records import dataclass

SOURCES = {"manifest": "named in octopus.yaml", "installed": "installed by octoform", "path": "found on PATH"}


class Status(StrEnum):
    """How a check ended."""

    PASS = "pass"
    FAIL = "fail"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Check:
    """One check: what was looked at, how it ended, what was seen, and what to do about it. No secret is in it."""

    name: str
    status: Status
    detail: str
    hint: str | None = None


def passed(name: str, detail: str) -> Check:
    """A check that went well."""
    return Check(name, Status.PASS, detail)


def failed(name: str, detail: str, hint: str | None = None) -> Check:
    """A check of something needed that is not as it must be."""
    return Check(name, Status.FAIL, detail, hint)


def unknown(name: str, detail: str, hint: str | None = None) -> Check:
    """A check that proves neither."""
    return Check(name, Status.UNKNOWN, detail, hint)


def program_checks(harness: ProgramHarness, environ: Mapping[str, str]) -> tuple[Check, ...]:
    """Program, version and node of a coding-agent program; starts it once for its version."""
    pin = harness.adapter.pin
    located = harness.locate(environ)
    install = f"octoform install {harness.name}"
    if located is None:
        return (failed("program", f"{pin.binary} is not installed", install),)
    path = shutil.which(located.argv[0], path=environ.get("PATH"))
    if path is None:
        detail = f"{located.argv[0]} ({SOURCES[located.source]}) is not there, or not executable"
        return (failed("program", detail, f"correct `command` in octopus.yaml, or leave it out and run {install}"),)
    there = passed("program", f"{path}, {SOURCES[located.source]}")
    version = _version(pin, located, environ, install)
    node = _node(pin, located, environ, install) if pin.node is not None else None
    return (there, version) if node is None else (there, version, node)


def _version(pin: Pin, located: Located, environ: Mapping[str, str], install: str) -> Check:
    stated = stated_version(located, environ)
    if stated.version is None:
        return failed("version", f"{pin.binary} --version: {stated.problem}", f"install it again: {install}")
    if stated.version != pin.version:
        detail = f"{stated.version}; octoform was tried with {pin.version}"
        return unknown("version", detail, f"if it causes problems: {install}, and no `command` in octopus.yaml")
    return passed("version", f"{stated.version}, the tried one")


def _node(pin: Pin, located: Located, environ: Mapping[str, str], install: str) -> Check | None:
    """The node that the program runs on; None where the machine needs none."""
    wanted = pin.node or (0, 0)
    version = node_version(located, environ)
    if version is not None and at_least(version, wanted):
        whose = "octoform's own" if located.path else "the machine's"
        return passed("node", f"{version}, {whose}; {dotted(wanted)} or newer is needed")
    detail = f"{version or 'no node'} on PATH; {pin.binary} {pin.version} needs {dotted(wanted)} or newer"
    if located.source == "installed":
        return failed("node", detail, f"{install} brings one")
    return unknown("node", detail, f"if it does not start: {install} brings one")


def sandbox_check(wanted: Sandbox | None, environ: Mapping[str, str]) -> Check:
    """Whether an agent can be confined here as it is wanted; tried out with a program that does nothing."""
    if wanted is None:
        return unknown(
            "sandbox", f"the agent runs without: {sandbox.unconfined(environ, None)}", "write `sandbox: auto`"
        )
    problem = sandbox.available(environ, wanted)
    if problem is None:
        lacks = sandbox.missing_walls(sandbox.kernel())
        if lacks:
            return unknown("sandbox", f"can be made, but lacks a wall: {'; '.join(lacks)}", "use a newer kernel")
        return passed("sandbox", "can be made")
    if wanted.required:
        return failed("sandbox", problem.summary, problem.hint)
    return unknown("sandbox", f"the agent runs without: {problem.summary}", problem.hint)


def command_check(program: str, environ: Mapping[str, str]) -> Check:
    """The program of the ``command`` harness."""
    path = shutil.which(program, path=environ.get("PATH"))
    if path is None:
        return failed("program", f"{program} is not there, or not executable", "correct `command` in octopus.yaml")
    return passed("program", str(Path(path)))


# Is the API of a model there, does it take the key, does it know the model: asked by its list of models.
#
# That list costs nothing and changes nothing. The question goes the way that the agent's own would: through a proxy
# only when the harness passes the proxy's variables on. A redirect is not followed, since the key would go along.

SECONDS = 5.0
LIST_BYTES = 16 << 20
PATHS = {ANTHROPIC: "/v1/models?limit=1000", GEMINI: "/v1beta/models?pageSize=1000"}
PATH = "/models"


@dataclass(frozen=True, slots=True)
class ApiAnswer:
    """The answer of the API: the HTTP status, or in ``problem`` why there is none; ``names`` are the listed models.

    ``names`` is None when the list is not complete or cannot be read.
    """

    status: int | None
    problem: str = ""
    names: frozenset[str] | None = None

    def refuses(self, api: str) -> bool:
        """True when the request was refused for its key; Google's API calls a wrong key a bad request."""
        return self.status in (401, 403) or (api == GEMINI and self.status == 400)


def model_checks(
    way: Access, key_name: str | None, environ: Mapping[str, str], passed_on: Sequence[str]
) -> list[Check]:
    """The key's variable, the API and the model; at most two requests of five seconds each.

    ``key_name`` is the variable with the key, None where none is needed; ``passed_on`` names the variables that the
    agent may see.
    """
    key = environ.get(key_name, "") if key_name else ""
    if key_name and not key:
        first = failed("key", f"{key_name} is not set", f"export {key_name}, or name another variable in `key`")
    elif not is_sendable(key):
        first = failed(
            "key", f"{key_name} holds blanks or characters that no request can carry", f"set {key_name} again"
        )
    else:
        proxies = _proxies(environ, passed_on)
        answer = ask(way, key, proxies)
        return [_key(way, key_name, proxies, answer), _api(way, answer, environ, passed_on), *_model(way, answer)]
    return [first, unknown("model API", f"{place(way)} was not asked without the key")]


def place(way: Access) -> str:
    """Where the API is, without anything secret that a URL can hold."""
    parts = urlsplit(way.base_url)
    return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}"


def ask(way: Access, key: str, proxies: Mapping[str, str]) -> ApiAnswer:
    """The list of models, within five seconds in all; never raises for what the other side does."""
    found: list[ApiAnswer] = []
    worker = threading.Thread(target=lambda: found.append(_get(way, key, proxies)), daemon=True)
    try:
        shortage.start(worker)
    except BlockingIOError as problem:
        return ApiAnswer(None, problem.strerror or shortage.TEXT)
    worker.join(SECONDS)
    return found[0] if found else _late()


def _late() -> ApiAnswer:
    return ApiAnswer(None, f"no answer within {SECONDS:g} s")


def _get(way: Access, key: str, proxies: Mapping[str, str]) -> ApiAnswer:
    if urlsplit(way.base_url).scheme not in ("http", "https"):
        return ApiAnswer(None, "this is no address of the web")  # the library would open a file just as well
    opener = urllib.request.build_opener(urllib.request.ProxyHandler(dict(proxies)), _NoRedirect)
    try:
        request = urllib.request.Request(f"{way.base_url}{PATHS.get(way.api, PATH)}", headers=_headers(way.api, key))
        with opener.open(request, timeout=SECONDS) as reply:
            return ApiAnswer(reply.status, names=_names(reply.read(LIST_BYTES)))
    except urllib.error.HTTPError as refusal:
        refusal.close()
        return ApiAnswer(refusal.code)
    except TimeoutError:
        return _late()
    except urllib.error.URLError as failure:
        if isinstance(failure.reason, TimeoutError):
            return _late()
        return ApiAnswer(None, str(getattr(failure.reason, "strerror", None) or failure.reason))
    except (OSError, ValueError, http.client.HTTPException) as failure:
        return ApiAnswer(None, str(failure) or type(failure).__name__)


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *_arguments: Any, **_keywords: Any) -> None:
        """Never: the answer is then the redirect itself."""


def _headers(api: str, key: str) -> dict[str, str]:
    headers = {"User-Agent": f"octoform/{octoform.__version__}", "Accept": "application/json"}
    if api == ANTHROPIC:
        headers["anthropic-version"] = "2023-06-01"
    if key:
        name = {ANTHROPIC: "x-api-key", GEMINI: "x-goog-api-key"}.get(api, "Authorization")
        headers[name] = key if api in PATHS else f"Bearer {key}"
    return headers


def _names(data: bytes) -> frozenset[str] | None:
    try:
        value = parse(data)
    except ValueError:
        return None
    if not isinstance(value, dict) or value.get("has_more") or value.get("nextPageToken"):
        return None
    return frozenset(_listed(value)) or None


def _listed(value: Mapping[str, Any]) -> Iterator[str]:
    for field, name in (("data", "id"), ("models", "name")):
        items = value.get(field)
        for item in items if isinstance(items, list) else ():
            if isinstance(item, dict) and isinstance(item.get(name), str):
                yield item[name].removeprefix("models/")


def _proxies(environ: Mapping[str, str], names: Sequence[str]) -> dict[str, str]:
    """The proxies that the agent would use, by scheme."""
    wanted = {"http_proxy": "http", "https_proxy": "https"}
    return {wanted[name.lower()]: environ[name] for name in names if name.lower() in wanted and environ.get(name)}


def _key(way: Access, name: str | None, proxies: Mapping[str, str], answer: ApiAnswer) -> Check:
    if answer.refuses(way.api):
        hint = f"check what {name} holds" if name else "name the variable with the key in `key`"
        return failed("key", f"{name or 'a request without a key'} was refused ({answer.status})", hint)
    if name is None:
        return passed("key", "none is needed")
    if answer.status != 200:
        return unknown("key", f"{name} is set; octoform could not test if it is accepted")
    without = ask(way, "", proxies)
    if without.refuses(way.api):
        return passed("key", f"{name} is set and accepted")
    return unknown("key", f"{name} is set; this API lists its models for anybody, so the key was not tried")


def _api(way: Access, answer: ApiAnswer, environ: Mapping[str, str], passed_on: Sequence[str]) -> Check:
    where = f"{place(way)} ({way.api})"
    if answer.status is None:
        unseen = _unseen_proxy(way, environ, passed_on)
        hint = f"{unseen} is set, but the agent does not see it: add it to `env` of the harness"
        if not unseen:
            hint = (
                UNTRUSTED_CERTIFICATE
                if is_untrusted_certificate(answer.problem or "")
                else "check `base_url` and the network"
            )
        return failed("model API", f"{where}: {answer.problem}", hint)
    if answer.status == 200 or answer.refuses(way.api):
        return passed("model API", f"{where} answers")
    hint = "check `base_url` and `api`" if answer.status < 500 else "try again later"
    return unknown("model API", f"{where} answered its list of models with status {answer.status}", hint)


def _unseen_proxy(way: Access, environ: Mapping[str, str], passed_on: Sequence[str]) -> str | None:
    """A variable with a proxy for this API that octoform has and the agent does not get."""
    parts = urlsplit(way.base_url)
    if is_loopback(way.base_url):
        return None
    names = [name for name in environ if name.lower() == f"{parts.scheme}_proxy"]
    return next((name for name in names if name not in passed_on), None)


def _model(way: Access, answer: ApiAnswer) -> list[Check]:
    """Whether the model is in the list; nothing when there is no list."""
    if answer.names is None:
        return []
    if way.model in answer.names:
        return [passed("model", f"{way.model} is listed")]
    near = did_you_mean(way.model, sorted(answer.names))
    hint = (
        f"did you mean {near!r}?" if near else "check `model` in octopus.yaml; some names are aliases that no list has"
    )
    return [unknown("model", f"{way.model} is not among the {len(answer.names)} models that the API lists", hint)]
