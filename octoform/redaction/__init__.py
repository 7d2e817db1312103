"""Secrets taken out of text, in whatever an agent prints: for logs, transcripts, prompts, diagnostics and outputs.

Two kinds are known. The values of named variables, in each spelling in which programs print them (raw, JSON, URL,
base64). And what shows by its form that it is a secret: tokens with well-known beginnings, authorization headers,
credentials in a URL, private keys. Anything else stays as it is: the serial numbers, hashes and frames of honest
hardware look random too. Light: an expression is compiled when a string first holds the fixed word of its form.
"""

from octoform.redaction.forms import found_in, spellings
from octoform.redaction.stream import Redactor, redacted

__all__ = ["Redactor", "found_in", "redacted", "spellings"]
