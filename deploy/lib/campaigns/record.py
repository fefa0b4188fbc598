"""What a campaign found: report.json while it runs, report.md for people, and the table of the latest runs."""

import json
import re
import subprocess
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

from parts import PARTS
from work import CORES, ROOT

BEGIN, END = "<!-- latest runs: written by deploy/campaign all --write -->\n", "<!-- end of latest runs -->\n"
HEAD = "| part | began | commit | cores | minutes | outcome |\n|---|---|---|--:|--:|---|\n"


def commit() -> str:
    """Of the sources, with a + if they are changed."""
    script = "program=deploy/campaign; . deploy/lib/common.sh; commit"
    return subprocess.check_output(["bash", "-c", script], cwd=ROOT, text=True)


@dataclass
class Outcome:
    name: str
    commit: str
    began: str = field(default_factory=lambda: time.strftime("%Y-%m-%d %H:%M"))
    cores: int = CORES
    minutes: float = 0
    passed: bool = False
    said: str = ""  # the last line

    def row(self) -> str:
        outcome = "passed" if self.passed else "failed"
        return f"| `{self.name}` | {self.began} | `{self.commit}` | {self.cores} | {self.minutes:.0f} | {outcome} |\n"


class Record:
    """The outcomes in one folder, in which each part has its own."""

    def __init__(self, folder: Path, resumes: bool):
        self.folder, self.outcomes = folder, {}
        self.file = folder / "report.json"
        if resumes and self.file.exists():
            self.outcomes = {entry["name"]: Outcome(**entry) for entry in json.loads(self.file.read_text())}

    def add(self, outcome: Outcome) -> None:
        self.outcomes[outcome.name] = outcome
        whole = self.folder / "report.json.part"  # a machine that stops leaves the old one or the new one
        whole.write_text(json.dumps([asdict(entry) for entry in self.outcomes.values()], indent=1) + "\n")
        whole.replace(self.file)
        (self.folder / "report.md").write_text(self.report())

    def passed(self) -> list[str]:
        return [outcome.name for outcome in self.outcomes.values() if outcome.passed]

    def count(self) -> str:
        return f"{len(self.passed())} passed, {len(self.outcomes) - len(self.passed())} failed"

    def report(self) -> str:
        rows = [outcome.row() for outcome in self.outcomes.values()]
        text = f"# Campaign\n\n{self.count()}.\n\n" + "".join([HEAD, *rows])
        for outcome in self.outcomes.values():
            part, folder = PARTS[outcome.name], self.folder / outcome.name
            text += f"\n## {part.name}\n\n{part.about[0].upper()}{part.about[1:]}.\n\n"
            if not outcome.passed:
                text += "```text\n" + "\n".join(last_lines(folder / "log.txt", 10)) + "\n```\n\n"
            if part.table and (folder / part.table).exists():
                text += re.sub(r"^#", "###", (folder / part.table).read_text(), flags=re.MULTILINE)
            text += f"\nAll of it is in `{part.name}/`.\n"
        return text


def last_lines(file: Path, count: int) -> list[str]:
    lines = [line.rstrip() for line in file.read_text(errors="replace").splitlines()] if file.exists() else []
    return [line for line in lines if line][-count:]


def write_latest(page: Path, outcomes: dict) -> None:
    """Puts the outcomes into the page's table of the latest runs; rows of other parts stay."""
    before, rest = page.read_text().split(BEGIN)
    table, after = rest.split(END)
    rows = {line.split("|")[1].strip(" `"): line for line in table.splitlines(keepends=True)}
    rows.update({name: outcome.row() for name, outcome in outcomes.items()})
    table = HEAD + "".join(rows.get(name, f"| `{name}` | | | | | |\n") for name in PARTS)
    page.write_text(before + BEGIN + table + END + after)
