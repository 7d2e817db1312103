"""What is known of the devices, for people: what had to be said of them, which profile serves which, what is asked."""

from collections.abc import Iterator, Sequence

from octoform.plan.model import Action, NearProfile, OpenQuestion, Plan, ProfileUse, ToldDevice
from octoform.views.format.console import Console
from octoform.views.format.values import one_line

WIDTH = 100
TIERS = {1: "nothing said", 2: "a name", 3: "a description"}
"""What a person had to say, by tier."""
_USES = {
    Action.NOOP: "holds for",
    Action.CREATE: "would then hold for",
    Action.DESTROY: "would no longer hold for",
}
_MARKS = {Action.NOOP: ("   ", "dim"), Action.CREATE: ("  +", "green"), Action.DESTROY: ("  -", "red")}


def show(plan: Plan, console: Console) -> None:
    """Tiers, profiles and questions of a plan; nothing where no device is known."""
    if plan.devices:
        console.line(f"\n{_counted(plan.devices)}")
    for device in plan.devices:
        if device.tier > 1:
            console.line(f"  {console.paint(str(device.tier), 'cyan')} {device.device} ({_told(device)})")
    told = {(device.profile, device.device) for device in plan.devices}
    uses = [item for item in plan.profiles if item.action is not Action.NOOP or (item.profile, item.device) not in told]
    if uses or plan.near:
        console.line("\nProfiles:")
    for action, profile, devices in _uses(uses):
        mark, colour = _MARKS[action]
        console.line(f"{console.paint(mark, colour)} {profile} {_USES[action]} {', '.join(devices)}")
    for profile in dict.fromkeys(item.profile for item in plan.near):
        _offer([item for item in plan.near if item.profile == profile], console)
    if plan.questions:
        console.line()
    ask(plan.questions, console)


def _offer(near: Sequence[NearProfile], console: Console) -> None:
    """A profile that lacks a word alone, the devices, and how it is said."""
    first, devices = near[0], ", ".join(item.device for item in near)
    mark = console.paint("  ?", "cyan")
    console.line(f"{mark} {first.profile} would hold for {one_line(devices, WIDTH)} if you said that it is one:")
    console.line(f'        octoform answer {first.device} "{one_line(first.word, WIDTH)}"')


def ask(questions: Sequence[OpenQuestion], console: Console) -> None:
    """The open questions, and how one is answered."""
    if not questions:
        return
    console.line("Devices whose meaning is missing:")
    for question in questions:
        wanted = console.paint(f", {TIERS[question.tier]} (tier {question.tier}) would tell", "dim")
        mark = console.paint("  ?", "cyan")
        console.line(f"{mark} {question.device} ({one_line(question.seen_as, WIDTH)}){wanted}")
        console.line(f"        {one_line(question.sentence, 2 * WIDTH)}")
    console.line(console.paint(f'  To answer:  octoform answer {questions[0].device} "..."', "dim"))
    # A name makes no tool of what only a line of its own commands can move: that needs limits and a way to stop.
    told = f"  What acts over a line needs a profile:  octoform profile new {questions[0].device}"
    console.line(console.paint(told, "dim"))


def _counted(devices: Sequence[ToldDevice]) -> str:
    """``Devices: 7 at tier 1 (nothing said), 1 at tier 2 (a name)``."""
    counts = ((tier, sum(1 for item in devices if item.tier == tier)) for tier in TIERS)
    words = (f"{count} at tier {tier} ({TIERS[tier]})" for tier, count in counts if count)
    return f"Devices: {', '.join(words)}"


def _told(device: ToldDevice) -> str:
    parts = [one_line(device.name, WIDTH)]
    parts += [f"by profile {device.profile}"] if device.profile else []
    parts += ["by an answer"] if device.answer and not device.profile else []
    return ", ".join(parts)


def _uses(uses: Sequence[ProfileUse]) -> Iterator[tuple[Action, str, list[str]]]:
    """One line for each profile and what becomes of it: those that stay, those that come, those that go."""
    for action in _USES:
        for profile in dict.fromkeys(item.profile for item in uses if item.action is action):
            yield action, profile, [item.device for item in uses if item.action is action and item.profile == profile]
