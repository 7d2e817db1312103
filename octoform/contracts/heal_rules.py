"""Rules for HEAL: one error, one action that fits its class, and code only where code is at fault.

What a rewritten server itself may be is held by SERVE's contract and by the comparison with the accepted one.
"""

from octoform.contracts import claim_rules, report_rules, text_rules
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.report_rules import Found, concerned, facts_of, source_of
from octoform.contracts.text import listed, pointer, shown
from octoform.diagnostics import did_you_mean, error

NONE = "none"
REWRITE = "rewrite"
ACTIONS = {
    "dependency": ("redeploy", REWRITE),
    "broken_tool": (REWRITE,),
    "corrupted_file": ("restore",),
    "dead_process": ("restart",),
    "device_moved": ("rediscover",),
    "none": (),
}
"""What may be done about an error of each class; nothing at all may always be done."""


def class_differs(value: JsonObject, artifacts: Artifacts) -> Found:
    """The class is that of the error, unless the error is handed back."""
    given = (facts_of(artifacts).error or {}).get("class")
    if given is None or value["class"] == given or value["status"] == "not_mine":
        return []
    summary = f"the error is of the class {given}, and {value['class']} was treated"
    hint = f"write {given}; if that is wrong, the status is not_mine and the action none"
    return [error("HEAL-CLASS-DIFFERS", summary, pointer="/class", hint=hint)]


def target_differs(value: JsonObject, artifacts: Artifacts) -> Found:
    """What was asked for is what was treated."""
    target = facts_of(artifacts).target
    if target is None or value["target"] == target:
        return []
    summary = f"the target is {shown(target)}, not {shown(value['target'])}"
    return [error("HEAL-TARGET-DIFFERS", summary, pointer="/target", hint=f"write {target}")]


def action_misfit(value: JsonObject, _: Artifacts) -> Found:
    """The action is one that mends this class, and there is one exactly where the report says that it repairs."""
    action, status, allowed = value["action"], value["status"], ACTIONS[value["class"]]
    problem = None
    if status == "repaired" and action == NONE:
        problem = "the status is repaired, and no action is named", "name the action, or write failed"
    elif status != "repaired" and action != NONE:
        problem = f"the status is {status}, and the action is {action}", "write none, or repaired"
    elif action not in (NONE, *allowed):
        hint = f"the class {value['class']} has {' or '.join(allowed)}" if allowed else "write none: a person is asked"
        problem = f"the action {action} mends no error of the class {value['class']}", hint
    if problem is None:
        return []
    return [error("HEAL-ACTION-MISFIT", problem[0], pointer="/action", hint=problem[1])]


def server_misfit(value: JsonObject, _: Artifacts) -> Found:
    """Code is handed over with a rewrite and with nothing else, and then the functions are named that differ."""
    rewrite, found = value["action"] == REWRITE, []
    if rewrite != (value["server"] is not None):
        summary = "the action is rewrite, and there is no server" if rewrite else "there is a server without a rewrite"
        found.append((summary, "/server", "write server.py" if rewrite else "write null"))
    if rewrite != bool(value["functions"]):
        summary = "no function is named that differs" if rewrite else "functions are named without a rewrite"
        found.append((summary, "/functions", "name each that you changed" if rewrite else "write an empty list"))
    return [error("HEAL-SERVER-MISFIT", summary, pointer=where, hint=hint) for summary, where, hint in found]


def foreign_function(value: JsonObject, artifacts: Artifacts) -> Found:
    """Only functions that are the tool's own are rewritten."""
    own, found = facts_of(artifacts).functions, []
    for index, name in enumerate(value["functions"]):
        if name not in own:
            near = did_you_mean(name, own)
            hint = f"did you mean {near}?" if near else f"the tool's own are {listed(list(own))}" if own else "none is"
            summary = f"the function {shown(name)} is not this tool's own"
            found.append(error("HEAL-FOREIGN-FUNCTION", summary, pointer=pointer("functions", index), hint=hint))
    return found


def unexplained(value: JsonObject, artifacts: Artifacts) -> Found:
    """A repair explains something that was read at its tool or device, or what the error itself rests on."""
    facts = facts_of(artifacts)
    cause = facts.error or {}
    known = set(facts.ids())
    wanted = concerned(facts.tool, cause.get("device"), artifacts)
    cited = [identity for identity in value["cites"] if identity in known]
    fits = any(identity in cause.get("cites", ()) or source_of(identity, artifacts) in wanted for identity in cited)
    if value["status"] != "repaired" or fits:
        return []
    summary = "nothing that is cited is about what was repaired"
    hint = "cite what the error rests on, or a reading or failure of the tool that your reason explains"
    return [error("HEAL-UNEXPLAINED", summary, pointer="/cites", hint=hint)]


RULES = (
    Rule("HEAL-UNESCAPED-TEXT", text_rules.in_values("HEAL-UNESCAPED-TEXT")),
    Rule("HEAL-UNKNOWN-READING", report_rules.unknown_reading("HEAL-UNKNOWN-READING")),
    Rule("HEAL-UNKNOWN-NAME", report_rules.unknown_name("HEAL-UNKNOWN-NAME")),
    Rule("HEAL-CLASS-DIFFERS", class_differs),
    Rule("HEAL-TARGET-DIFFERS", target_differs),
    Rule("HEAL-ACTION-MISFIT", action_misfit),
    Rule("HEAL-SERVER-MISFIT", server_misfit),
    Rule("HEAL-FOREIGN-FUNCTION", foreign_function),
    Rule("HEAL-UNEXPLAINED", unexplained),
    Rule("HEAL-ORDERS", report_rules.orders("HEAL-ORDERS")),
    *claim_rules.rules("HEAL"),
)
