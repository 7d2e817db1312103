"""A model's side on loopback that follows a script, so that agents are tested whole and without a network.

It answers as five kinds of services do (chat completions, responses, messages, generateContent, Ollama's chat),
streaming or not, and can fail in the ways that they fail in.

    with serve({"turns": [{"shell": "echo hi > out"}, {"text": "done"}]}) as server:
        server.url, server.requests

Script
    turns          list of turns, the last one repeats; a script may be that list alone
    usage          {"input": N, "cached": N, "output": N} of every reply; the cached are among the input
    index          "ids" (default): the turn is read off the call ids in a request, so that retries and side requests
                   do not move the script on; "counter": each good reply moves it on
    side           False: a request without tools is a turn too; else it gets a short text and counts for nothing
    models_status  the status of a request for the list of models (default 200)
    models_key     the key without which that list is refused with 401

Turn, one of
    {"shell": COMMAND}            one call of whichever shell tool the client has; "{turn}" in it is the turn's number
    {"tool": NAME, "args": {}}    one call of that tool
    {"calls": [TURN, ...]}        several calls in one reply
    {"text": TEXT}                words and no call, which ends most loops; may stand beside a call
    {"malformed": KIND}           a call that is none: json (broken arguments), unknown_tool, missing_args
    {"status": N, "headers": {}}  an HTTP error
    {"drop": "head" | "mid"}      the connection closed before the reply or within it
and besides: "delay": S before the reply, "stall": S within it, "usage" of this reply, "fail_first": turns that are
served once each before this one.
"""

from model_server.serving import ModelServer, serve

__all__ = ["ModelServer", "serve"]
