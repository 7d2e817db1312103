"""Commands on octoform itself: help, version, completion.

A command imports what it needs when it is chosen: all others cost nothing.
"""

from __future__ import annotations

import argparse
from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path

from octoform.cli.parser import build, parse
from octoform.views.format import problems
from octoform.views.format.console import Console

# Scripts by which a shell completes octoform's commands, verbs and options.
#
# They hold all words by themselves: pressing a key must not start Python. They are made from the parser, so that they
# cannot differ from ``--help``.

_BASH = """\
# octoform: source <(octoform completion bash)
_octoform() {{
    local word place="" skip="" words=""
    for word in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
        if [ -n "$skip" ]; then skip=""; continue; fi
        case "$word" in
            -chdir|--chdir) skip=1 ;;
            -*) ;;
            *) case " {places} " in *" ${{place:+$place/}}$word "*) place="${{place:+$place/}}$word" ;; esac ;;
        esac
    done
    case "$place" in
{cases}
    esac
    COMPREPLY=($(compgen -W "$words" -- "${{COMP_WORDS[COMP_CWORD]}}"))
    [ ${{#COMPREPLY[@]}} -gt 0 ] || COMPREPLY=($(compgen -f -- "${{COMP_WORDS[COMP_CWORD]}}"))
}}
complete -o filenames -F _octoform octoform"""
_ZSH = """\
# octoform: source <(octoform completion zsh)
autoload -U +X compinit && compinit -u
autoload -U +X bashcompinit && bashcompinit
"""


def script(shell: str) -> str:
    """The script for ``bash``, ``zsh`` or ``fish``."""
    if shell == "fish":
        return "\n".join(_fish())
    places = dict(_places(build(), ()))
    cases = "\n".join(f'        "{"/".join(place)}") words="{" ".join(words)}" ;;' for place, words in places.items())
    names = " ".join("/".join(place) for place in places if place)
    bash = _BASH.format(places=names, cases=cases)
    return _ZSH + bash if shell == "zsh" else bash


def _places(parser: argparse.ArgumentParser, place: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], list[str]]]:
    """Each command, or command and verb, with the words that may follow."""
    verbs = _verbs(parser)
    chosen = [str(word) for action in parser._actions if action.choices and not verbs for word in action.choices]
    yield place, [*verbs, *chosen, *(option for option, _ in _options(parser))]
    for name, verb in verbs.items():
        yield from _places(verb, (*place, name))


def _verbs(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """The commands below a parser; argparse has no public list of them."""
    return next((dict(each.choices) for each in parser._actions if isinstance(each, argparse._SubParsersAction)), {})


def _options(parser: argparse.ArgumentParser) -> list[tuple[str, str]]:
    """The options in their first form, each with its help."""
    return [(each.option_strings[0], each.help or "") for each in parser._actions if each.option_strings]


def _fish() -> Iterator[str]:
    parser = build()
    yield "# octoform: octoform completion fish | source"
    helps = {item.dest: item.help for each in parser._actions for item in getattr(each, "_choices_actions", ())}
    top = "-n __fish_use_subcommand"
    for name in _verbs(parser):
        yield f"complete -c octoform {top} -a {name} -d {_quoted(helps.get(name) or '')}"
    yield from (f"complete -c octoform {top} -o {option[1:]} -d {_quoted(text)}" for option, text in _options(parser))
    for name, command in _verbs(parser).items():
        seen = f"-n '__fish_seen_subcommand_from {name}'"
        for verb, below in _verbs(command).items():
            yield f"complete -c octoform {seen} -a {verb} -d {_quoted(below.description or '')}"
        for option, text in _options(command):
            yield f"complete -c octoform {seen} -o {option.lstrip('-')} -d {_quoted(text)}"


def _quoted(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"


def run_help(arguments: Namespace, _: Path, __: Console) -> int:
    """Prints what ``octoform COMMAND --help`` prints."""
    try:
        parse([*arguments.words, "--help"])
    except SystemExit:  # how argparse ends after its help
        return 0
    return 1


def run_version(arguments: Namespace, _: Path, screen: Console) -> int:
    """Exit code 0."""
    return problems.version(screen, as_json=arguments.json)


def run_completion(arguments: Namespace, _: Path, screen: Console) -> int:
    """Prints the script; exit code 0."""
    screen.line(script(arguments.shell))
    return 0
