"""choice_test.py ROOT BUILD: what deploy/test --changed chooses is never too small.

What ninja knows decides: from its graph and the headers that the compiler has named for each object, the
files that each test's programs are really made of. A change of any of these files has to choose the test.
"""

import re
import subprocess
import sys
from pathlib import Path

ROOT, BUILD = Path(sys.argv[1]), Path(sys.argv[2])
sys.path.insert(0, str(ROOT / "deploy/lib"))
from checks.plan import Plan  # noqa: E402


def ninja(*arguments: str) -> str:
    return subprocess.run(["ninja", "-C", str(BUILD), *arguments], capture_output=True, text=True, check=True).stdout


def read_graph(targets: list[str]) -> dict[str, set[str]]:
    """What each output below the targets is directly made of, by ninja's files and by the compiler's lists of headers."""
    made_of: dict[str, set[str]] = {}
    path, arrows = {}, []  # rules have a shape, and no path
    for line in ninja("-t", "graph", *targets).splitlines():
        if match := re.match(r'^"(0x[0-9a-f]+)" -> "(0x[0-9a-f]+)"', line):
            arrows.append((match[1], match[2]))
        elif (match := re.match(r'^"(0x[0-9a-f]+)" \[label="([^"]*)"', line)) and "shape=" not in line:
            path[match[1]] = match[2]
    for start, end in arrows:
        made_of.setdefault(path.get(end, end), set()).add(path.get(start, start))
    output = None
    for line in ninja("-t", "deps").splitlines():
        if match := re.match(r"^(\S+): #deps", line):
            output = match[1]
        elif line.startswith("    "):
            made_of.setdefault(output, set()).add(line.strip())
    return made_of


def files_of(output: str, made_of: dict[str, set[str]]) -> set[str]:
    """Files of the repository that an output is made of, however indirectly."""
    seen: set[str] = set()
    waiting = [output]
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen.add(name)
            waiting += made_of.get(name, ())
    found = set()
    for name in seen:
        path = (BUILD / name).resolve()
        if path.is_relative_to(ROOT) and not path.is_relative_to(BUILD) and path.is_file():
            found.add(str(path.relative_to(ROOT)))
    return found


def main() -> None:
    plan = Plan(ROOT, BUILD)
    made_of = read_graph(sorted({target for test in plan.tests.values() for target in test.targets}))
    files: dict[str, set[str]] = {}  # of each target
    too_small, pairs = [], 0
    chosen_for: dict[str, set[str]] = {}
    for test in plan.tests.values():
        for target in test.targets:
            if target not in files:
                files[target] = files_of(target, made_of)
            for file in files[target]:
                if file.startswith("build/"):  # sources that deploy/setup brought
                    continue
                if file not in chosen_for:
                    chosen_for[file] = set(plan.reached_by([file])[0])
                pairs += 1
                if test.name not in chosen_for[file]:
                    too_small.append(f"{file} is part of {target}, and its change does not choose {test.name}")
    print("\n".join(too_small[:20]))
    print(f"{len(chosen_for)} files, {pairs} pairs of file and test")
    # A graph that was not read would let everything pass.
    for file, target in (("common/base/result.h", "base_test"), ("common/wire/framing.cpp", "wire_test"),
                         ("tests/support/random.h", "wire_test")):
        if target in files and file not in files[target]:
            too_small.append(f"{file} is not seen as a part of {target}")
            print(too_small[-1])
    if not chosen_for:
        print("nothing is built")
    sys.exit(1 if too_small or not chosen_for else 0)


main()
