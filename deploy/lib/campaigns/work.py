"""How a part of the campaign works: it builds, calls programs, keeps what they say, and fails with a reason."""

import os
import re
import subprocess
from collections import Counter
from html import unescape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
CORES = len(os.sched_getaffinity(0))
BUILD = 'program=deploy/campaign with_tests=true; . deploy/lib/common.sh; with_web=$1; shift; build "$@"'


class Failed(Exception):
    """What is said in one line, and the exit code: 1 a law is broken, 2 usage, 3 a file, 5 something is missing."""

    def __init__(self, code: int, text: str):
        super().__init__(text)
        self.code = code


class Work:
    """One part while it runs: its options and the folder of its reports. Programs start in the repository."""

    def __init__(self, options, out: Path):
        self.options, self.out = options, out

    def yes(self) -> list[str]:
        return ["--yes"] if self.options.yes else []

    def path(self, name: str) -> str:
        return str(self.out / name)

    def build(self, preset: str, *targets: str, web: bool = False) -> None:
        self.call("bash", "-c", BUILD, "build", "true" if web else "false", preset, *targets,
                  why="the build failed, see above")

    def call(self, *command: str, to: str = "", codes: tuple = (0,), why: str = "", env: dict | None = None) -> int:
        """Runs a program; with `to` what it says on stdout goes to that file of the folder, too."""
        with subprocess.Popen(command, cwd=ROOT, env={**os.environ, **(env or {})}, text=True, errors="replace",
                              stdout=subprocess.PIPE if to else None) as program:
            if to:
                with open(self.out / to, "w") as file:
                    for line in program.stdout:
                        print(line, end="", flush=True)
                        file.write(line)
        if program.returncode not in codes:
            raise Failed(program.returncode if program.returncode in (2, 3, 5) else 1,
                         why or f"{Path(command[0]).name} ended with {program.returncode}, see {self.out}")
        return program.returncode

    def side_by_side(self, commands: list, env=lambda number: {}, to: str = "") -> list[int]:
        """Starts all at once, each with its own file for what it says, and waits; their exit codes."""
        programs = []
        for number, command in enumerate(commands):
            with open(self.path(to.format(number)), "w") as file:
                variables = {**os.environ, **env(number)}
                programs.append(subprocess.Popen(command, cwd=ROOT, env=variables, stdout=file))
        return [program.wait() for program in programs]

    def run_suite(self, preset: str, *options: str, env: dict | None = None) -> None:
        """All tests of a build, those of the campaign included."""
        self.run_tests("python3", "-B", "-m", "checks.suite", f"build/{preset}", *options,
                       env={"PYTHONPATH": f"{ROOT}/deploy/lib", **(env or {})})

    def run_tests(self, *command: str, env: dict | None = None) -> None:
        """Runs tests that leave JUnit reports in the folder, and makes a table of them; fails if one did."""
        for report in self.out.glob("*.xml"):
            report.unlink()
        code = self.call(*command, "--out", str(self.out), codes=range(256), env=env)
        text, failed = suite_table([file.read_text(errors="replace") for file in sorted(self.out.glob("*.xml"))])
        (self.out / "table.md").write_text(text)
        print(text, flush=True)
        if failed or code:
            raise Failed(1, f"{failed} tests failed, see {self.out}" if failed else f"{command[0]} ended with {code}")


def suite_table(reports: list[str]) -> tuple[str, int]:
    """Of JUnit reports: how many tests, which failed or were skipped, the ten slowest; how many failed."""
    seconds, outcomes, lines = Counter(), Counter(), []
    for case in (case for report in reports for case in report.split("<testcase ")[1:]):
        name, time = (re.search(rf'\b{key}="([^"]*)"', case) for key in ("name", "time"))
        outcome = "passed"
        if "<skipped" in case:
            outcome = "skipped"
        elif "<failure" in case:
            outcome = "failed"
        outcomes[outcome] += 1
        test = unescape(name[1])
        program = test.split(".")[0] if test.count(".") > 1 else test  # program.Suite.Test, or a script's own name
        seconds[program] += float(time[1]) if time else 0
        if outcome != "passed":
            lines.append(f"- {outcome}: `{test}`")
    if not outcomes:
        return "No test ran.\n", 1
    text = ", ".join(f"{outcomes[kind]} {kind}" for kind in ("passed", "failed", "skipped")) + ".\n\n"
    text += "".join(f"{line}\n" for line in sorted(lines)) + ("\n" if lines else "")
    text += "| the slowest | s |\n|---|--:|\n"
    text += "".join(f"| `{name}` | {time:.1f} |\n" for name, time in seconds.most_common(10))
    return text, outcomes["failed"]
