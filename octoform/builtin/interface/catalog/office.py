"""Printers: what they say of themselves. Printing is left to the print service of the system."""

from octoform.builtin.interface.kinds import Kind
from octoform.builtin.interface.schemas import FLAG, TEXT, listing, record

PRINTER = record(
    "Printer",
    device=TEXT,
    online=FLAG,
    out_of_paper=FLAG,
    error=FLAG,
    maker=TEXT,
    model=TEXT,
    languages=listing(TEXT),
)

KINDS = (
    Kind(
        "read_printer_status",
        "Read whether the printer is online, out of paper or in error, and which languages it takes. Prints nothing.",
        PRINTER,
        60,
    ),
)
