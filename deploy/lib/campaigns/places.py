"""places.py CONTRIBUTING.md TESTS.json: whether the table "Which test runs where" is true of a build.

TESTS.json is what the build wrote (build/<preset>/tests.json). Each fault is one line; the exit code is 1 if there
is any.
"""

import json
import re
import sys
from pathlib import Path

HEADING, PLACE = "Which test runs where", "`deploy/campaign tests`"


def named_tests(page: str) -> set[str]:
    """The tests in the first cells of the table's rows for the campaign."""
    section = page.partition(f"\n## {HEADING}\n")[2].partition("\n## ")[0]
    rows = [line.split("|") for line in section.splitlines() if line.startswith("|")]
    return {name for row in rows if len(row) > 2 and PLACE in row[2] for name in re.findall(r"`([^`]+)`", row[1])}


def faults(page: str, tests: list[dict]) -> list[str]:
    named, marked = named_tests(page), {test["name"] for test in tests if test["part"] == "campaign"}
    everything = {test["name"] for test in tests}
    if not named:
        return [f'"{HEADING}" has no test with {PLACE} in its second cell']
    said = {"is marked CAMPAIGN, but not named: add it": marked - named,
            "is named, but not marked CAMPAIGN": named & everything - marked,
            "is named, but there is no such test": named - everything}
    return [f'"{HEADING}": {name} {what}' for what, names in said.items() for name in sorted(names)]


def main(words: list[str]) -> int:
    if len(words) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    try:
        found = faults(Path(words[0]).read_text(), json.loads(Path(words[1]).read_text())["tests"])
    except (OSError, ValueError, KeyError) as error:
        print(f"places.py: {words[1]} or {words[0]}: {error}", file=sys.stderr)
        return 3
    for fault in found:
        print(f"{words[0]}: {fault}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
