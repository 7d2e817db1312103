"""The certificates that agents and installations trust: the person's own, else the system's."""

import ssl
from collections.abc import Iterator
from pathlib import Path

import pytest
from model_server import ModelServer, serve

from octoform.diagnostics import Diagnostic, is_untrusted_certificate
from octoform.harness.containment.agent_environment import certificates, minimal
from octoform.harness.llm.completion import Condensed, LiteLLMCompletion
from octoform.manifest.model import Housekeeping

CERTIFICATE = Path(__file__).parents[2] / "cases" / "tls" / "server.pem"
"""One that no store has, for localhost, with its key."""


@pytest.fixture
def model() -> Iterator[ModelServer]:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(CERTIFICATE)
    with serve({"turns": [{"text": "an answer"}], "side": False}) as server:
        server.socket = context.wrap_socket(server.socket, server_side=True)
        yield server


def answer(server: ModelServer, **environ: str) -> Condensed | Diagnostic:
    keeper = Housekeeping("openai/scripted", 200, key="K", base_url=f"https://localhost:{server.server_address[1]}")
    asker = LiteLLMCompletion(keeper, {"PATH": "/usr/bin:/bin", "K": "key", **environ}, backoff_seconds=0.01)
    return asker.complete("a text", "an instruction")


def test_the_persons_own_come_first_and_the_systems_store_else(tmp_path: Path) -> None:
    store = tmp_path / "store.crt"
    stores = (str(tmp_path / "absent"), str(store))
    assert certificates({}, stores) == {}
    store.write_text("certificates")
    assert certificates({}, stores) == {"SSL_CERT_FILE": str(store), "NODE_EXTRA_CA_CERTS": str(store)}
    own = {"SSL_CERT_FILE": "/own.pem", "REQUESTS_CA_BUNDLE": "/other.pem"}
    assert certificates({**own, "SECRET": "x"}, stores) == {**own, "NODE_EXTRA_CA_CERTS": "/own.pem"}
    assert certificates({"SSL_CERT_DIR": "/d", "NODE_EXTRA_CA_CERTS": "/n"}, stores) == {
        "SSL_CERT_DIR": "/d",
        "NODE_EXTRA_CA_CERTS": "/n",
    }
    assert minimal(tmp_path, own)["SSL_CERT_FILE"] == "/own.pem"


@pytest.mark.slow
def test_a_model_behind_an_own_certificate_is_asked_and_else_the_certificate_is_named(
    model: ModelServer,
) -> None:
    reply = answer(model, SSL_CERT_FILE=str(CERTIFICATE))
    assert isinstance(reply, Condensed) and reply.text == "an answer"
    refused = answer(model)
    assert isinstance(refused, Diagnostic) and is_untrusted_certificate(f"{refused.summary} {refused.detail}"), refused
