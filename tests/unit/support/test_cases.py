"""`for_each` passes every case, and a failure names all cases that failed."""

from pathlib import Path

import pytest
from cases import for_each, share


def test_every_case_is_passed_with_a_folder_of_its_own(tmp_path: Path) -> None:
    seen: list[tuple[int, str, Path]] = []

    @for_each("number", [1, 2])
    @for_each("letter", "ab")
    def test(number: int, letter: str, tmp_path: Path) -> None:
        assert list(tmp_path.iterdir()) == []
        seen.append((number, letter, tmp_path))

    test(tmp_path=tmp_path)
    assert [each[:2] for each in seen] == [(1, "a"), (1, "b"), (2, "a"), (2, "b")]
    assert len({folder for *_, folder in seen}) == 4


def test_a_failure_names_all_that_failed() -> None:
    @for_each("number", range(5))
    def test(number: int) -> None:
        assert number % 2

    with pytest.raises(ExceptionGroup, match="3 of 5 cases failed") as found:
        test()
    assert [problem.__notes__ for problem in found.value.exceptions] == [[f"number = {each}"] for each in (0, 2, 4)]


def test_what_is_no_failed_assertion_ends_it_with_its_case() -> None:
    @for_each("number", [0])
    def test(number: int) -> None:
        raise KeyError(number)

    with pytest.raises(KeyError) as found:
        test()
    assert found.value.__notes__ == ["number = 0"]


def test_no_case_at_all_is_an_error() -> None:
    with pytest.raises(AssertionError, match="no case"):
        for_each("number", [])


def test_a_case_of_several_parameters_is_a_tuple() -> None:
    seen = []

    @for_each(("one", "two"), [(1, 2), (3, 4)])
    def test(one: int, two: int) -> None:
        seen.append(one * two)

    test()
    assert seen == [2, 12]


def test_a_share_is_every_so_many_th_and_the_first_of_each_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("WHOLE", raising=False)
    words = ["a1", "a2", "b1", "a3", "a4", "b2", "c1"]
    assert share(words, 3) == ["a1", "a3", "c1"]
    assert share(words, 3, lambda word: word[0]) == ["a1", "b1", "a3", "c1"]
    seen = []

    @for_each("word", words, every=4)
    def test(word: str) -> None:
        seen.append(word)

    test()
    assert seen == ["a1", "a4"]
    monkeypatch.setenv("WHOLE", "1")
    assert share(words, 3) == words
