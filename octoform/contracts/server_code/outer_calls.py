"""What a generated server gets of the runtime, of the system and of its values when it calls them, computed."""

import ast
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from octoform.contracts.server_code.computed_values import (
    METHODS,
    UNKNOWN,
    DeviceOfRuntime,
    Inner,
    Later,
    Method,
    OpenFile,
    Place,
    Pool,
    Unsure,
    World,
    is_known,
    is_plain,
    is_unknown,
    plainly,
)

Enter = Callable[[Inner, Sequence[Any], Mapping[str, Any]], Any]
_STARTS = frozenset({"run", "check_call", "check_output", "call", "Popen"})
_QUIET = frozenset({"flush", "close", "seek", "fsync", "lseek", "truncate", "ftruncate", "fdatasync"})
"""What moves no number: a file is closed, written through, or read from its begin."""


class OuterCalls:
    """The calls of what is not a function of the file."""

    def __init__(self, world: World, enter: Enter, strange: Callable[..., Any]) -> None:
        self._world, self._enter, self._strange = world, enter, strange

    def of_runtime(self, node: ast.Call, name: str, given: list[Any], named: Mapping[str, Any]) -> Any:
        """The result of a function of the runtime."""
        first = given[0] if given else None
        if name == "device":
            return DeviceOfRuntime(first) if isinstance(first, str) else UNKNOWN
        if name == "bus":
            return first
        if name == "child.call":
            return self._run(node, first, given[1:], {})
        if name in ("read_number", "read_integer", "read_text", "read_first") and isinstance(first, Place):
            text = self._world.text(first)
            if is_unknown(text) or name == "read_text":
                return text
            number = plainly(float, text)
            scale = named.get("scale", given[1] if name == "read_number" and len(given) > 1 else 1.0)
            if name == "read_integer":
                return plainly(int, number)
            return plainly(operator.mul, number, scale) if is_plain(scale) else UNKNOWN
        if name == "files" and isinstance(first, Place):
            return [Place((*first.key, item.replace("*", "1"))) for item in given[1:] if isinstance(item, str)]
        return self._strange(node, *given)

    def of_system(self, node: ast.Call, name: str, given: list[Any], named: Mapping[str, Any]) -> Any:
        """The result of a descriptor, a program or a thread."""
        first = given[0] if given else named.get("args")
        module, _, last = name.rpartition(".")
        if name in ("os.open", "os.fdopen") and isinstance(first, (Place, OpenFile)):
            return OpenFile(first) if isinstance(first, Place) else first
        if module == "os" and isinstance(first, OpenFile) and (last in ("read", "write", "pwrite", "pread")):
            return self.of_place(node, Method(first, last.removeprefix("p")), given[1:])
        if module == "os" and isinstance(first, OpenFile) and last in _QUIET:
            return None
        if module == "subprocess" and last in _STARTS:
            return self._start(node, first, named)
        if name in ("asyncio.to_thread", "asyncio.run", "asyncio.wait_for"):
            return self._run(node, first, given[1:], named) if isinstance(first, Inner | Method) else first
        if name == "asyncio.gather":
            return given
        if name == "asyncio.sleep":
            return None
        if name in ("threading.Thread", "threading.Timer"):
            target = named.get("target", given[1] if last == "Timer" and len(given) > 1 else None)
            rows, words = named.get("args", ()), named.get("kwargs", {})
            known = isinstance(target, Inner | Method) and isinstance(rows, list | tuple) and isinstance(words, dict)
            return Later(target, rows, words) if known else self._strange(node)
        if last == "ThreadPoolExecutor":
            return Pool()
        return self._strange(node, *given)

    def of_value(self, node: ast.Call, method: Method, given: list[Any], named: Mapping[str, Any]) -> Any:
        """The result of a method of a value."""
        owner, name = method.owner, method.name
        first = given[0] if given else None
        if isinstance(owner, DeviceOfRuntime):
            kind = [first] if name in ("path", "paths") and isinstance(first, str) else []
            places = [Place((owner.name, each)) for each in kind]
            return owner if name == "bus" else places if name == "paths" else places[0] if places else UNKNOWN
        if isinstance(owner, (Place, OpenFile)):
            return self.of_place(node, method, given)
        if isinstance(owner, (Later, Pool)):
            return self._of_thread(node, owner, name, given, named)
        if name in METHODS and is_known(owner) and hasattr(owner, name):
            parts = (owner, *given, *named.values())
            if name in ("append", "get", "items", "values", "keys", "copy", "update") or all(map(is_plain, parts)):
                return plainly(getattr(owner, name), *given, **named)
            return UNKNOWN
        return self._strange(node, owner, *given)

    def of_place(self, node: ast.Call, method: Method, given: list[Any]) -> Any:
        """The result of a method of a path or an open file."""
        owner, name = method.owner, method.name
        place = owner.place if isinstance(owner, OpenFile) else owner
        first = given[0] if given else None
        if name in ("read_text", "read_bytes", "read", "readline"):
            text = self._world.text(place)
            known = not is_unknown(text)
            return text if not known else f"{text}\n".encode() if name == "read_bytes" else f"{text}\n"
        if name in ("write_text", "write_bytes", "write"):
            return self.write(place, first, node)
        if name == "writelines":
            rows: list[Any] = list(first) if isinstance(first, list | tuple) else [None]
            return self.write(place, "".join(rows) if all(isinstance(item, str) for item in rows) else None, node)
        if name in ("joinpath", "with_name") and given and all(isinstance(item, str) for item in given):
            return Place((*(place.key if name == "joinpath" else place.key[:-1]), *given))
        if name == "open":
            return OpenFile(place)
        if name in ("resolve", "absolute", "fileno", "__enter__"):
            return owner
        return None if name in _QUIET and isinstance(owner, OpenFile) else self._strange(node)

    def write(self, place: Place, text: Any, node: ast.Call) -> None:
        """An attribute has this text from now on; Unsure where it is not known."""
        text = text.decode("utf-8", "replace") if isinstance(text, bytes) else text
        if not isinstance(text, str):
            raise Unsure
        self._world.stored[place.key] = text.strip()
        self._world.written[place.key] = node

    def _start(self, node: ast.Call, words: Any, named: Mapping[str, Any]) -> Any:
        """A program: `tee` writes what it is given; of another only its words are known."""
        if not isinstance(words, list | tuple) or not words or not isinstance(words[0], str):
            raise Unsure
        if words[0].rpartition("/")[2] == "tee" and isinstance(words[-1], Place):
            return self.write(words[-1], named.get("input"), node)
        self._world.ran.append((node, [item for item in words if isinstance(item, str)]))
        return UNKNOWN

    def _of_thread(
        self, node: ast.Call, owner: Later | Pool, name: str, given: list[Any], named: Mapping[str, Any]
    ) -> Any:
        """A thread does at once what it is started for; whether its caller waits for it is another rule's."""
        if isinstance(owner, Pool):
            if name == "submit" and given:
                return Later(given[0], result=self._run(node, given[0], given[1:], named))
            return None if name == "shutdown" else self._strange(node)
        if name == "start":
            self._run(node, owner.called, list(owner.given), owner.named)
        return owner.result if name == "result" else None

    def _run(self, node: ast.Call, what: Any, given: list[Any], named: Mapping[str, Any]) -> Any:
        if isinstance(what, Inner):
            return self._enter(what, given, named)
        return self.of_value(node, what, given, named) if isinstance(what, Method) else self._strange(node)
