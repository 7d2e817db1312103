"""The gate between stages: what an agent wrote is believed only after this package has read it.

Light names are re-exported here. `check` lives in `octoform.contracts.checking`, which is heavy (jsonschema) and is
imported only where an artifact is really checked.
"""

from octoform.contracts.canon import canonical, output_digest
from octoform.contracts.instance import instances, pseudonymise
from octoform.contracts.model import Artifacts, ProfileFacts, Rule
from octoform.contracts.parsing import parse

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
