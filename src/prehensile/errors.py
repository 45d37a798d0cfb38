"""The error that every room raises for bad input from a user.

The command line prints it without a traceback and exits with status 2.
"""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One fault in something a user gave us, and how to mend it.

    Attributes:
        message: what is wrong, in one sentence.
        mend: what to do about it, in one sentence ("" if the message says it already).
        file: the file it stands in ("" if it did not come from a file).
        line: 1-based line in that file (0 if unknown).
        key: path of the offending field, such as ``cameras.camera0.width`` ("" if none).
    """

    message: str
    mend: str = ""
    file: str = ""
    line: int = 0
    key: str = ""

    def __str__(self) -> str:
        place = self.file + (f":{self.line}" if self.file and self.line else "")
        where = ": ".join(part for part in (place, self.key) if part)
        text = f"{where}: {self.message}" if where else self.message
        return f"{text} ({self.mend})" if self.mend else text


class InputError(ValueError):
    """Bad input: a file, a field or an argument that cannot be used as it is.

    Holds all findings at once; the text of the error has one line for each.
    """

    def __init__(self, *findings: Finding | str) -> None:
        self.findings: Sequence[Finding] = tuple(
            f if isinstance(f, Finding) else Finding(f) for f in findings
        )
        super().__init__("\n".join(str(f) for f in self.findings))
