"""Octoform's own clients of the endpoint: for a person, and for the check that proves it alive."""
