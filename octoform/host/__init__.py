"""What this host is, read-only: a fingerprint of what its kernel announces, nothing opened and nothing interpreted."""

from octoform.host.fingerprint import Fingerprint, difference, fingerprint, root_from_environment

__all__ = ["Fingerprint", "difference", "fingerprint", "root_from_environment"]
