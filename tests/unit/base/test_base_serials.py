"""A serial number proves one unit only where no one would have typed it; a default proves nothing."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.base.serials import NONE, PATTERN, UNIQUE, is_distinctive, same, weight

DEFAULTS = [
    *("03000200-0400-0500-0006-000700080009", "0100020003000400", "FIXME001", "changeme-01"),
    *(
        "0001",
        "0002",
        "123456",
        "0123456789",
        "1234567890ABCDEF",
        "0123456789ABCDEF",
        "00000000",
        "1111111111",
        "ffffff",
    ),
    *(
        "000000000000",
        "00000001",
        "000000000001",
        "987654321",
        "12345678",
        "12121212",
        "A1A1A1A1",
        "10203040",
        "123123",
    ),
    *("112233445566", "AABBCCDD1", "abc123", "ABC-12345", "200901010001", "20230512", "2008-04-11", "SN0001", "S/N: 1"),
    *(
        "SN000123456",
        "0x0001",
        "0x12345678",
        "1.0",
        "V1.00",
        "rev 01",
        "1",
        "0",
        "Serial Number 1",
        "usb0001",
        "100001",
    ),
    *("1234-5678-9ABC", "fedcba9876543210", "0000-0000-0001", "001", "12", "TEST001", "Device 0001", "ffff0000"),
]
TYPED = [
    *("1f00:00c1", "1F00_00C1", "0000:00:14.0", "3-1.2", "6.1.0-13-amd64", "Linux_6.1", "v1.2.3"),
    *(
        "XY123456",
        "ABCD1234",
        "SN-2020-0001",
        "12AB34CD",
        "02468ACE",
        "13579BDF",
        "2468101214",
        "10111213",
        "314159265",
    ),
    *("DEADBEEF", "BADC0FFEE0DDF00D", "CAFEBABE0001", "QWERTY123", "asdf1234", "00e04c000001", "00E04C680001"),
    *("01012020", "31122019", "12/31/2019", "01/01/1970", "99991231", "Jan 1 2020", "2019W52", "build 20210517"),
    *(
        "FW20210517",
        "TESTSERIAL001",
        "PROTO001",
        "DEMO001",
        "Factory0001",
        "SERIALNUMBER12345",
        "hello123",
        "foobar123",
    ),
    *("12345678-1234-5678-9abc-def012345678", "12345678-1234-5678-90ab-cddeefaabbcc", "1357924680", "135792468"),
    *(
        "0246813579",
        "16180339",
        "11235813",
        "112358132134",
        "1248163264",
        "1qaz2wsx",
        "zaq12wsx",
        "159753",
        "789456123",
    ),
    *("\u0661\u0662\u0663\u0664\u0665\u0666", "\uff10\uff10\uff10\uff11", "\u0d67\u0d68\u0d69\u0d6a\u0d6b\u0d6c"),
]
"""Of what people and programs write where a number should stand: ids, places, versions, rows, words; in any script."""
WORDS = [
    "",
    " ",
    "Serial Number",
    "N/A",
    "To be filled by O.E.M.",
    "Default string",
    "None",
    "Not Specified",
    "Default",
    "NA",
    "To_be_filled_by_O.E.M.",
    "ToBeFilledByO.E.M.",
]
GOOD = [
    "A10KZP4X",
    "D744C4C5",
    "8K1172",
    "5&2F7A91C4",
    "75735303231351F0C1A2",
    "00417A2-B9",
    "A5-0001",
    "FT4UKM93",
    "482913",
    "3F2A9C",
    "0F6A31",
    "CB2104",
    "83650274",
    "DM01Q7ZT",
    "2021-0938-6172",
    "123e4567-e89b-42d3-a456-426614174000",
]


@pytest.mark.parametrize("serial", [*DEFAULTS, *TYPED, *WORDS])
def test_a_default_tells_nothing_apart(serial: str) -> None:
    assert weight(serial) < UNIQUE
    assert not is_distinctive(serial)
    assert not is_distinctive(serial, ["D744C4C5"])
    assert weight(serial) in (NONE, PATTERN)


@pytest.mark.parametrize("serial", GOOD)
def test_a_number_of_its_own_does(serial: str) -> None:
    assert is_distinctive(serial) and is_distinctive(serial, ["0001"])
    assert not is_distinctive(serial, [serial.lower()]), "one that two units share is no number"


def test_a_short_number_counts_where_units_show_different_ones() -> None:
    assert not is_distinctive("A5")
    assert is_distinctive("A5", ["B7"])
    assert not is_distinctive("A5", ["B7", "0001"])


@pytest.mark.parametrize("serial", ["CP2102", "FT232R", "CP2102N USB to UART"])
def test_what_reads_like_the_name_of_a_chip_needs_another_that_differs(serial: str) -> None:
    assert not is_distinctive(serial)


@pytest.mark.parametrize("said", ["Otter Cam 3000-X2", "1f00 00c1"])
def test_what_names_the_kind_is_no_number(said: str) -> None:
    assert weight(said.replace(" ", "_"), [said]) == NONE
    assert weight("OT2102", ["OT2102 Otter Bridge Controller"]) == NONE


@given(st.integers(0, 9999), st.sampled_from("0123456789abcdef"), st.integers(1, 20))
def test_counts_and_repeated_symbols_are_defaults_in_any_width(start: int, symbol: str, width: int) -> None:
    ring = "0123456789" * 4
    begin = start % 10
    assert weight(ring[begin : begin + width]) < UNIQUE
    assert weight(ring[begin : begin + width][::-1]) < UNIQUE
    assert weight(symbol * width) == NONE
    assert weight(f"{start % 10:0{width}d}") < UNIQUE


@given(st.text(max_size=300) | st.text(st.characters(categories=["Nd", "No", "Nl"]), max_size=20))
def test_any_text_is_judged(serial: str) -> None:
    assert weight(serial, [serial]) in range(4) and same(serial, serial) == bool(serial)
