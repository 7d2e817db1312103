"""Specs and prompts: what an agent is told. Device-agnostic prose in ``protocol/``, rendered and bounded here."""

from octoform.protocol.model import STAGES, Spec
from octoform.protocol.paths import schema_dir, spec_paths
from octoform.protocol.prompt import MOST_PROMPT_BYTES, Prompt, PromptTooLarge, render_prompt

__all__ = [
    "MOST_PROMPT_BYTES",
    "STAGES",
    "Prompt",
    "PromptTooLarge",
    "Spec",
    "render_prompt",
    "schema_dir",
    "spec_paths",
]
