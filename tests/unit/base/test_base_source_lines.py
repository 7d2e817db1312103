"""Which lines of a server count: what lists the members of a result does not, with its decorators and its docstring."""

from octoform.base.source_lines import counted

SERVER = '''\
import runtime

@dataclass(
    frozen=True,
)
class Level:
    """The level."""

    level: float
    unit: str = "%"

Row = TypedDict("Row", {"name": str})

@dataclass
class Lamp:
    level: float

    def off(self) -> None:
        self.level = 0
'''


def test_a_class_that_only_lists_members_does_not_count_and_neither_do_its_decorators() -> None:
    lines = SERVER.splitlines()
    assert [lines[number - 1].strip() for number in counted(SERVER)] == [
        "import runtime",
        "@dataclass",
        "class Lamp:",
        "level: float",
        "def off(self) -> None:",
        "self.level = 0",
    ]
