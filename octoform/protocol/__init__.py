"""Specs and prompts: what an agent is told. Device-agnostic prose in ``protocol/``, rendered and bounded here."""

from octoform.protocol.model import STAGES, Spec
from octoform.protocol.prompt import MOST_PROMPT_BYTES, Prompt, render_prompt

__all__ = ["MOST_PROMPT_BYTES", "STAGES", "Prompt", "Spec", "render_prompt"]
