"""The gate between stages: what an agent wrote is believed only after this package has read it.

Light names are re-exported here. `check` lives in `octoform.contracts.contract_check`, which is heavy (jsonschema) and
is imported only where an artifact is really checked.
"""

from octoform.contracts.artifact_parser import parse
from octoform.contracts.canonical import canonical, output_digest
from octoform.contracts.host_identity import instances, pseudonymise
from octoform.contracts.model import Artifacts, ProfileFacts, Rule

__all__ = [
    "Artifacts",
    "ProfileFacts",
    "Rule",
    "canonical",
    "instances",
    "output_digest",
    "parse",
    "pseudonymise",
]
