"""Specs and prompts: what an agent is notified. Device-agnostic prose in ``protocol/``, rendered and bounded here."""

from octoform.protocol.model import (
    DUTIES,
    STAGES,
    STEP,
    Proof,
    Spec,
    Step,
    own_path,
    schema_dir,
    spec_paths,
    step_paths,
)
from octoform.protocol.prompt import MAX_PROMPT_BYTES, Prompt, PromptTooLarge, render_prompt

__all__ = [
    "DUTIES",
    "MAX_PROMPT_BYTES",
    "STAGES",
    "STEP",
    "Prompt",
    "PromptTooLarge",
    "Proof",
    "Spec",
    "Step",
    "own_path",
    "render_prompt",
    "schema_dir",
    "spec_paths",
    "step_paths",
]
