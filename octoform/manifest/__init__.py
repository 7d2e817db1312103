"""The manifest: octopus.yaml read, checked and turned into frozen values.

``model`` and ``compiled`` are light and may be imported on any path; ``loading``, ``schema`` and ``editing`` bring
the YAML reader and pydantic with them and belong behind a lazy import.
"""
