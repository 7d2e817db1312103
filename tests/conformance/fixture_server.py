# /// script
# requires-python = ">=3.11"
# dependencies = ["fastmcp>=4.1,<4.2"]
# ///
"""A server with what the conformance suites ask for by name, as if an agent had written it for an invented host.

It goes through the launcher like every other one, so what the suites see is what clients of a real host see; only that
its resources, prompts and completions are served, which the launcher otherwise leaves out.
One device of that host can be unplugged by a call: the list of tools then changes the way it does in a room.
"""

import base64
import json
import os
import shutil
from pathlib import Path
from typing import Annotated, Any

import anyio
import mcp_types as mt
from fastmcp import Context, FastMCP
from fastmcp.exceptions import ToolError
from fastmcp.prompts import Message, PromptResult
from fastmcp.resources import ResourceContent, ResourceResult
from fastmcp.tools import Tool, ToolResult
from mcp.shared.exceptions import MCPError
from mcp_types import InputRequests, InputRequiredResult
from pydantic import Field

mcp = FastMCP("conformance", version="1.0", dereference_schemas=False)

PNG = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mP8z8BQDwAEhQGAhKmMIQAAAABJRU5ErkJggg=="
WAV = base64.b64encode(
    b"RIFF\x26\0\0\0WAVEfmt \x10\0\0\0\1\0\1\0\x40\x1f\0\0\x80\x3e\0\0\2\0\x10\0data\2\0\0\0\0\0"
).decode()
IMAGE = mt.ImageContent(type="image", data=PNG, mime_type="image/png")
NAME_FORM = {"type": "object", "properties": {"name": {"type": "string"}}, "required": ["name"]}


def text(words: str) -> mt.TextContent:
    return mt.TextContent(type="text", text=words)


def embedded(uri: str, words: str, mime_type: str = "text/plain") -> mt.EmbeddedResource:
    contents = mt.TextResourceContents(uri=uri, mime_type=mime_type, text=words)
    return mt.EmbeddedResource(type="resource", resource=contents)


def ask(message: str, form: dict[str, Any]) -> mt.ElicitRequest:
    return mt.ElicitRequest(params=mt.ElicitRequestFormParams(message=message, requested_schema=form))


def sample(words: str, most: int = 100) -> mt.CreateMessageRequest:
    messages = [mt.SamplingMessage(role="user", content=text(words))]
    return mt.CreateMessageRequest(params=mt.CreateMessageRequestParams(messages=messages, max_tokens=most))


def reply(ctx: Context, key: str) -> Any:
    """What the client answered to an input request; None while it has not."""
    return (ctx.input_responses or {}).get(key)


def form_of(answer: Any) -> dict[str, Any] | None:
    """The form of an accepted elicitation; None for anything else."""
    return answer.content if isinstance(answer, mt.ElicitResult) and answer.action == "accept" else None


# ---- both eras: contents, errors, progress ----


@mcp.tool
def test_simple_text() -> ToolResult:
    """Give a text."""
    return ToolResult(content=[text("This is a simple text response for testing.")])


@mcp.tool
def test_image_content() -> ToolResult:
    """Give a picture."""
    return ToolResult(content=[IMAGE])


@mcp.tool
def test_audio_content() -> ToolResult:
    """Give a sound."""
    return ToolResult(content=[mt.AudioContent(type="audio", data=WAV, mime_type="audio/wav")])


@mcp.tool
def test_embedded_resource() -> ToolResult:
    """Give a resource."""
    return ToolResult(content=[embedded("test://embedded-resource", "This is an embedded resource content.")])


@mcp.tool
def test_multiple_content_types() -> ToolResult:
    """Give a text, a picture and a resource."""
    resource = embedded("test://mixed-content-resource", '{"test":"data","value":123}', "application/json")
    return ToolResult(content=[text("Multiple content types test:"), IMAGE, resource])


@mcp.tool
def test_error_handling() -> str:
    """Fail."""
    raise ToolError("This tool intentionally returns an error for testing")


@mcp.tool
async def test_tool_with_logging(ctx: Context) -> str:
    """Say three things while working."""
    for words in ("Tool execution started", "Tool processing data", "Tool execution completed"):
        await ctx.info(words)
        await anyio.sleep(0.05)
    return "done"


@mcp.tool
async def test_logging_tool(ctx: Context) -> str:
    """Say something, to who asked for it."""
    await ctx.info("working")
    return "done"


@mcp.tool
async def test_tool_with_progress(ctx: Context) -> str:
    """Report progress three times."""
    for progress in (0, 50, 100):
        await ctx.report_progress(progress, 100)
        await anyio.sleep(0.05)
    return "done"


@mcp.tool
async def test_reconnection(ctx: Context) -> str:
    """End the stream in the middle of the call; the answer is there for who comes again."""
    await ctx.close_sse_stream()
    await anyio.sleep(0.2)
    return "Reconnection test completed successfully"


# ---- the handshake era: questions to the client ----


@mcp.tool
async def test_sampling(prompt: str, ctx: Context) -> str:
    """Let the client's model speak."""
    messages = [mt.SamplingMessage(role="user", content=text(prompt))]
    result = await ctx.session.create_message(messages, max_tokens=100, related_request_id=ctx.request_id)
    return f"LLM response: {getattr(result.content, 'text', '')}"


async def elicited(ctx: Context, message: str, properties: dict[str, Any]) -> str:
    form = {"type": "object", "properties": properties}
    result = await ctx.session.elicit_form(message, form, related_request_id=ctx.request_id)
    return f"action={result.action}, content={json.dumps(result.content)}"


@mcp.tool
async def test_elicitation(message: str, ctx: Context) -> str:
    """Ask the person."""
    fields = {"username": {"type": "string"}, "email": {"type": "string"}}
    return "User response: " + await elicited(ctx, message, fields)


@mcp.tool
async def test_elicitation_sep1034_defaults(ctx: Context) -> str:
    """Ask with defaults."""
    fields = {
        "name": {"type": "string", "default": "John Doe"},
        "age": {"type": "integer", "default": 30},
        "score": {"type": "number", "default": 95.5},
        "status": {"type": "string", "enum": ["active", "inactive", "pending"], "default": "active"},
        "verified": {"type": "boolean", "default": True},
    }
    return "Elicitation completed: " + await elicited(ctx, "Please review", fields)


def titled(*titles: str) -> list[dict[str, str]]:
    return [{"const": f"value{number}", "title": title} for number, title in enumerate(titles, 1)]


@mcp.tool
async def test_elicitation_sep1330_enums(ctx: Context) -> str:
    """Ask for choices, written in all five ways."""
    options = ["option1", "option2", "option3"]
    names = ["Option One", "Option Two", "Option Three"]
    fields = {
        "untitledSingle": {"type": "string", "enum": options},
        "titledSingle": {"type": "string", "oneOf": titled("First Option", "Second Option", "Third Option")},
        "legacyEnum": {"type": "string", "enum": ["opt1", "opt2", "opt3"], "enumNames": names},
        "untitledMulti": {"type": "array", "items": {"type": "string", "enum": options}},
        "titledMulti": {"type": "array", "items": {"anyOf": titled("First Choice", "Second Choice", "Third Choice")}},
    }
    return "Elicitation completed: " + await elicited(ctx, "Please choose", fields)


# ---- the later era: results that ask for input ----


@mcp.tool
def test_input_required_result_elicitation(ctx: Context) -> Any:
    """Ask for a name, then greet."""
    name = (form_of(reply(ctx, "user_name")) or {}).get("name")
    if not isinstance(name, str):
        return InputRequiredResult(input_requests={"user_name": ask("What is your name?", NAME_FORM)})
    return f"Hello, {name}!"


@mcp.tool
def test_input_required_result_sampling(ctx: Context) -> Any:
    """Ask the client's model."""
    answer = reply(ctx, "capital_question")
    if not isinstance(answer, mt.CreateMessageResult):
        return InputRequiredResult(input_requests={"capital_question": sample("What is the capital of France?")})
    return f"The model says: {getattr(answer.content, 'text', '')}"


@mcp.tool
def test_input_required_result_list_roots(ctx: Context) -> Any:
    """Ask for the client's roots."""
    answer = reply(ctx, "client_roots")
    if not isinstance(answer, mt.ListRootsResult):
        return InputRequiredResult(input_requests={"client_roots": mt.ListRootsRequest(params=mt.RequestParams())})
    return "roots: " + ", ".join(str(root.uri) for root in answer.roots)


@mcp.tool
def test_input_required_result_request_state(ctx: Context) -> Any:
    """Ask, and recognise the state that comes back."""
    form = {"type": "object", "properties": {"ok": {"type": "boolean"}}, "required": ["ok"]}
    if reply(ctx, "confirm") is None:
        return InputRequiredResult(input_requests={"confirm": ask("Please confirm", form)}, request_state="confirming")
    return "state-ok" if ctx.request_state == "confirming" else "state-lost"


@mcp.tool
def test_input_required_result_tampered_state(ctx: Context) -> Any:
    """Ask, with a state that must not be changed on the way (it is sealed)."""
    return test_input_required_result_request_state(ctx)


@mcp.tool
def test_input_required_result_multiple_inputs(ctx: Context) -> Any:
    """Ask three things at once."""
    wanted = ("user_name", "greeting", "client_roots")
    if any(reply(ctx, key) is None for key in wanted):
        return InputRequiredResult(
            input_requests={
                "user_name": ask("What is your name?", NAME_FORM),
                "greeting": sample("Generate a greeting", 50),
                "client_roots": mt.ListRootsRequest(params=mt.RequestParams()),
            },
            request_state="three",
        )
    return "all three came"


@mcp.tool
def test_input_required_result_multi_round(ctx: Context) -> Any:
    """Ask one thing after the other."""
    color = {"type": "object", "properties": {"color": {"type": "string"}}, "required": ["color"]}
    state = ctx.request_state or ""
    if reply(ctx, "step2") is not None and state.startswith("2:"):
        return f"{state[2:]} likes {(form_of(reply(ctx, 'step2')) or {}).get('color')}"
    if reply(ctx, "step1") is not None and state == "1":
        name = (form_of(reply(ctx, "step1")) or {}).get("name")
        step: InputRequests = {"step2": ask("Step 2: What is your favorite color?", color)}
        return InputRequiredResult(input_requests=step, request_state=f"2:{name}")
    step = {"step1": ask("Step 1: What is your name?", NAME_FORM)}
    return InputRequiredResult(input_requests=step, request_state="1")


@mcp.tool
def test_input_required_result_capabilities(ctx: Context) -> Any:
    """Ask only in the ways that the client can answer."""
    able = ctx.session.client_capabilities or mt.ClientCapabilities()
    requests: dict[str, Any] = {}
    if able.sampling is not None:
        requests["greeting"] = sample("Generate a greeting")
    if able.elicitation is not None:
        requests["user_name"] = ask("What is your name?", NAME_FORM)
    return InputRequiredResult(input_requests=requests) if requests and not ctx.input_responses else "done"


@mcp.tool
def test_streaming_elicitation(ctx: Context) -> Any:
    """Ask within the stream of the answer."""
    return test_input_required_result_elicitation(ctx)


@mcp.tool
def test_missing_capability(ctx: Context) -> str:
    """Need the client's model."""
    able = ctx.session.client_capabilities
    if able is None or able.sampling is None:
        needed: dict[str, Any] = {"requiredCapabilities": {"sampling": {}}}
        raise MCPError(code=-32021, message="the client has to be able to sample", data=needed)
    return "sampling is there"


# ---- schemas, headers, and a list of tools that changes ----


@mcp.tool
def test_custom_headers(
    region: Annotated[str, Field(json_schema_extra={"x-mcp-header": "Region"})] = "",
) -> str:
    """Take a parameter that a header repeats."""
    return f"region {region}"


SCHEMA = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "type": "object",
    "$defs": {
        "address": {
            "$anchor": "addressDef",
            "type": "object",
            "properties": {"street": {"type": "string"}, "city": {"type": "string"}},
        }
    },
    "properties": {
        "name": {"type": "string"},
        "address": {"$ref": "#/$defs/address"},
        "contactMethod": {"type": "string", "enum": ["phone", "email"]},
        "phone": {"type": "string"},
        "email": {"type": "string"},
    },
    "allOf": [{"anyOf": [{"required": ["phone"]}, {"required": ["email"]}]}],
    "if": {"properties": {"contactMethod": {"const": "phone"}}, "required": ["contactMethod"]},
    "then": {"required": ["phone"]},
    "else": {"required": ["email"]},
    "additionalProperties": False,
}


def of_schema(name: str = "", address: Any = None) -> str:
    return f"{name} {address}"


mcp.add_tool(
    Tool.from_function(
        of_schema, name="json_schema_2020_12_tool", description="Take what a schema with the newer words allows."
    ).model_copy(update={"parameters": SCHEMA})
)


@mcp.tool
def read_thermometer() -> str:
    """Read the invented thermometer; the list of tools lacks it when it is unplugged."""
    return "21 degrees"


@mcp.tool
def test_trigger_tool_change() -> str:
    """Unplug the invented thermometer, or plug it in again."""
    here = Path(os.environ["OCTOFORM_SYSROOT"]) / "sys/class/hwmon"
    away = here.with_name("unplugged")
    shutil.move(here if here.exists() else away, away if here.exists() else here)
    return "unplugged" if away.exists() else "plugged in"


# ---- resources, prompts, completion ----


@mcp.resource("test://static-text", mime_type="text/plain")
def static_text() -> str:
    """A text."""
    return "This is the content of the static text resource."


@mcp.resource("test://static-binary", mime_type="image/png")
def static_binary() -> bytes:
    """A picture."""
    return base64.b64decode(PNG)


@mcp.resource("test://watched-resource", mime_type="text/plain")
def watched_resource() -> str:
    """A text to subscribe to."""
    return "Watched."


@mcp.resource("test://template/{id}/data", mime_type="application/json")
def template_data(id: str) -> ResourceResult:
    """What was asked for."""
    found = {"id": id, "templateTest": True, "data": f"Data for ID: {id}"}
    return ResourceResult([ResourceContent(json.dumps(found), "application/json")])


@mcp.prompt
def test_simple_prompt() -> str:
    """A prompt."""
    return "This is a simple prompt for testing."


@mcp.prompt
def test_prompt_with_arguments(arg1: str, arg2: str) -> str:
    """A prompt with arguments."""
    return f"Prompt with arguments: arg1='{arg1}', arg2='{arg2}'"


@mcp.prompt
def test_prompt_with_embedded_resource(resourceUri: str) -> PromptResult:
    """A prompt with a resource."""
    resource = embedded(resourceUri, "Embedded resource content for testing.")
    return PromptResult([Message(resource), Message("Please process the embedded resource above.")])


@mcp.prompt
def test_prompt_with_image() -> PromptResult:
    """A prompt with a picture."""
    return PromptResult([Message(IMAGE), Message("Please analyze the image above.")])


@mcp.prompt
def test_input_required_result_prompt(ctx: Context) -> Any:
    """A prompt that asks first."""
    form = {"type": "object", "properties": {"context": {"type": "string"}}, "required": ["context"]}
    answer = form_of(reply(ctx, "user_context"))
    if answer is None:
        return InputRequiredResult(input_requests={"user_context": ask("What context should the prompt use?", form)})
    return f"Use this context: {answer.get('context')}"


@mcp.completion
def completion(ref: Any, argument: Any, context: Any) -> list[str]:
    """Words for an argument."""
    return [word for word in ("paris", "park", "party", "test") if word.startswith(argument.value)]


if __name__ == "__main__":
    mcp.run(show_banner=False)
