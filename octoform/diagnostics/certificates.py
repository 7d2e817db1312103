"""A certificate that a program does not trust: in which words programs say so, and what to do about it."""

import re

UNTRUSTED = (
    "put the authority's certificate (of a proxy that inspects TLS: the proxy's) into the system's store, "
    "or name its file in SSL_CERT_FILE"
)
_WORDS = re.compile(
    r"certificate[ _]verify[ _]failed|UnknownIssuer|UNABLE_TO_\w*(SIGNATURE|ISSUER)|SELF_SIGNED_CERT", re.IGNORECASE
)


def is_untrusted(text: str) -> bool:
    """True when a program's words say that it does not trust the other side's certificate."""
    return _WORDS.search(text) is not None
