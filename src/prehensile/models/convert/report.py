"""What a conversion changed, said in full: nothing is repaired or dropped in silence."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from prehensile.files import write_atomic, write_json


@dataclass(frozen=True)
class Change:
    """One thing that the converted model has otherwise than its source.

    Attributes:
        kind: what it concerns: mesh, collision, inertia, joint, actuator, contact, frame, base,
            dropped or note.
        subject: the link, joint, mesh or element.
        text: what was done, and why, in one sentence.
        line: 1-based line in the source file (0: none).
    """

    kind: str
    subject: str
    text: str
    line: int = 0


@dataclass
class Report:
    """The account of one conversion.

    Attributes:
        source: the file that was converted.
        format: URDF, SDF, MJCF or mesh.
        changes: in the order in which they were made.
        summary: what Drake found in the result: number of links, joints, actuators, mass, ...
    """

    source: Path
    format: str
    changes: list[Change] = field(default_factory=list)
    summary: dict[str, Any] = field(default_factory=dict)

    def add(self, kind: str, subject: str, text: str, line: int = 0) -> None:
        """Notes a change, once."""
        change = Change(kind, subject, text, line)
        if change not in self.changes:
            self.changes.append(change)

    def write(self, folder: Path) -> None:
        """Writes ``report.json`` and ``report.md`` into a folder."""
        content = {
            "source": self.source.name,
            "format": self.format,
            "summary": self.summary,
            "changes": [asdict(change) for change in self.changes],
        }
        write_json(folder / "report.json", content)
        lines = [f"# Conversion of {_cell(self.source.name)} ({self.format})", ""]
        lines += [f"- {key}: {value}" for key, value in self.summary.items()]
        lines += ["", "| kind | subject | change | line |", "|---|---|---|---|"]
        lines += [
            f"| {c.kind} | {_cell(c.subject)} | {_cell(c.text)} | {c.line or ''} |"
            for c in self.changes
        ]
        write_atomic(folder / "report.md", "\n".join(lines) + "\n")


def _cell(text: str) -> str:
    """Text of others in a table of ours: no bar or markup of theirs takes effect."""
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")
