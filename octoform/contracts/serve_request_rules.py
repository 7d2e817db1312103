"""The rule for SERVE about what a reading sends over a raw line of which nobody says how it is driven.

A sensor on a serial line answers a question, and the question is the same each time. What is made of a caller's
arguments may be a goal for a motor, and readings are called without asking anybody.
"""

import ast
from collections.abc import Iterator, Sequence

from octoform.contracts.model import Artifacts, Rule
from octoform.contracts.raw_line_rules import unknown_lines
from octoform.contracts.serve_exchange_rules import opens_line
from octoform.contracts.serve_flow import Flow
from octoform.contracts.serve_origins import Origin
from octoform.contracts.serve_reading_rules import flow_of_tools
from octoform.contracts.serve_tool_rules import served_tools, tool_functions
from octoform.contracts.source import Function, Source, needed_source
from octoform.contracts.text import listed, shown
from octoform.diagnostics import Diagnostic

CODE = "SERVE-REQUEST-NOT-FIXED"
_SENDS = frozenset(
    {"write", "writelines", "writev", "send", "sendall", "sendto", "send_feature_report", "send_output_report", "xfer"}
    | {"xfer2", "xfer3", "writebytes", "writebytes2", "ctrl_transfer", "write_bytes", "write_text", "i2c_rdwr", "ioctl"}
    | {"write_byte", "write_byte_data", "write_word_data", "write_block_data", "write_i2c_block_data", "write_quick"}
    | {"query", "ask", "exchange", "transfer", "pwrite", "bulkWrite", "controlWrite", "interruptWrite"}
)
_WRITES = frozenset({"write", "writelines", "writev", "send", "sendall", "pwrite"})
_DEPTH = 8
Used = Sequence[Function]


def request_not_fixed(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """What a tool of effect ``read`` sends to such a device is written in the file."""
    source = needed_source(value)
    flow = flow_of_tools(source, artifacts)
    unknown = unknown_lines(artifacts)
    out: dict[ast.AST, Diagnostic] = {}
    for site, tool in served_tools(source, artifacts):
        concerned = sorted(unknown.intersection(tool["devices"]))
        if tool["effect"] != "read" or not concerned:
            continue
        used = source.entered_from(tool_functions(source, site))
        found = (
            (node, why) for node in source.nodes if source.owner(node) in used for why in _why(source, flow, used, node)
        )
        for node, why in found:
            summary = f"what {shown(site.name or '')} sends to {listed(concerned)} {why}"
            hint = "send a written request, or one of a table of them; what needs more needs a profile"
            out.setdefault(node, source.problem(CODE, node, summary, hint))
    return list(out.values())


RULES = (Rule(CODE, request_not_fixed),)


def _why(source: Source, flow: Flow, used: Used, node: ast.AST) -> Iterator[str]:
    """Why what is sent at a node is not fixed"""
    lined = isinstance(node, ast.Call | ast.Attribute) and any(opens_line(source, function) for function in used)
    if lined and isinstance(node, ast.Attribute) and node.attr in _WRITES and isinstance(node.ctx, ast.Load):
        above = source.parents.get(node)
        if not (isinstance(above, ast.Call) and above.func is node):
            yield "goes out under another name, and cannot be seen"
    if not isinstance(node, ast.Call):
        return
    name = source.dotted(node.func)
    method = name.rpartition(".")[2]
    given = [*node.args, *(each.value for each in node.keywords)]
    if lined and (method in ("copyfileobj", "methodcaller") or (name == "print" and _printed(source, node))):
        yield "goes out by way of another function, and cannot be seen"
    elif method not in _SENDS or any(item.name == name for item in source.functions):
        return  # what a function of the file does with it is looked at by itself
    elif lined and method in _WRITES and not _is_text(flow, used, given[-1:], _DEPTH):
        yield "is no text of this file"
    elif any(_is_open(flow, used, item, _DEPTH) for item in given):
        yield "depends on the caller"


def _printed(source: Source, call: ast.Call) -> bool:
    target = next((item.value for item in call.keywords if item.arg == "file"), None)
    return target is not None and source.dotted(target) != "sys.stderr"


def _is_text(flow: Flow, used: Used, nodes: Sequence[ast.AST | None], depth: int) -> bool:
    """Whether all of these are certainly texts that stand in the file."""
    return depth > 0 and all(node is not None and _is_one_text(flow, used, node, depth) for node in nodes)


def _is_one_text(flow: Flow, used: Used, node: ast.AST, depth: int) -> bool:
    if isinstance(node, ast.Constant):
        return isinstance(node.value, str | bytes | int)
    if isinstance(node, ast.Subscript):
        return _is_text(flow, used, [node.value], depth - 1)
    if isinstance(node, ast.Name):
        values = flow.plain(node) or flow.handed(node, used)
        return bool(values) and _is_text(flow, used, values, depth - 1)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in ("get", "encode"):
        return _is_text(flow, used, [node.func.value], depth - 1)
    if isinstance(node, ast.IfExp):
        return _is_text(flow, used, [node.body, node.orelse], depth - 1)
    if isinstance(node, ast.BinOp):
        return _is_text(flow, used, [node.left, node.right], depth - 1)
    if isinstance(node, ast.JoinedStr | ast.Dict | ast.List | ast.Tuple):
        return _is_text(flow, used, node.elts if isinstance(node, ast.List | ast.Tuple) else node.values, depth - 1)
    return isinstance(node, ast.FormattedValue) and _is_text(flow, used, [node.value], depth - 1)


def _is_open(flow: Flow, used: Used, node: ast.expr, depth: int) -> bool:
    """Whether a text is made of what a caller gave; a choice among written ones is not."""
    if not flow.of(node) & Origin.ARGUMENT:
        return False
    if depth == 0:
        return True
    if isinstance(node, ast.Subscript):
        return _is_open(flow, used, node.value, depth - 1)
    if isinstance(node, ast.IfExp):
        return _is_open(flow, used, node.body, depth - 1) or _is_open(flow, used, node.orelse, depth - 1)
    if isinstance(node, ast.Name):
        values = flow.plain(node) or flow.handed(node, used)
        return not values or any(
            isinstance(each, ast.expr) and _is_open(flow, used, each, depth - 1) for each in values
        )
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in ("get", "encode"):
        return _is_open(flow, used, node.func.value, depth - 1)
    if isinstance(node, ast.Attribute):
        return _is_open(flow, used, node.value, depth - 1)
    parts = [item for item in ast.iter_child_nodes(node) if isinstance(item, ast.expr)]
    return any(_is_open(flow, used, item, depth - 1) for item in parts) if parts else True
