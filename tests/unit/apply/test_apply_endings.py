"""How the end of a run is reported to a person, and which ends make another attempt useless."""

from pathlib import Path

from octoform.apply.stage.acceptance import ended_well
from octoform.apply.stage.attempt_loop import HOPELESS
from octoform.harness.port import ExitReason, Outcome, Task, TaskLimits


def a_task(folder: Path) -> Task:
    return Task(
        stage="probe",
        attempt=1,
        workdir=folder,
        prompt=folder / "prompt.md",
        output=folder / "output.json",
        log=folder / "task.log",
        document=folder / "task.json",
        model="openai/nothing",
        environment={},
        limits=TaskLimits(60.0, idle_seconds=30.0, turns=20, usd=1.0),
    )


def test_a_refused_model_is_named_with_the_providers_words_and_not_asked_again(tmp_path: Path) -> None:
    words = "stopped; 404 The model `nothing` does not exist"
    (found,) = ended_well(Outcome(ExitReason.REFUSED, -15, 1.0, words, turns=0), a_task(tmp_path))
    assert (found.code, found.detail) == ("APPLY-MODEL-REFUSED", words)
    assert "openai/nothing" in found.summary
    assert ExitReason.REFUSED in HOPELESS


def test_every_end_has_words(tmp_path: Path) -> None:
    for reason in ExitReason:
        found = ended_well(Outcome(reason, 0, 1.0, turns=0), a_task(tmp_path))
        assert bool(found) is (reason is not ExitReason.FINISHED)
