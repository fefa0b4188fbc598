#!/usr/bin/env python3
"""Runs ninja, and says meanwhile how far it is and about how long it still takes.

On a terminal one line changes; elsewhere a line comes every ten seconds. What a step prints is passed
on whole: of a build without faults nothing but these lines is seen.

The time left is the work left over the pace so far. Work is in seconds: those that a step took the last
time, by ninja's own log, else a guess by what its sources include.
"""
import argparse
import functools
import json
import os
import re
import select
import shutil
import subprocess
import sys
import time
from pathlib import Path

STATUS = re.compile(r"\[(\d+)/(\d+)\] (.*)")
ROOT = Path(__file__).resolve().parents[2]
# Seconds on one core of a machine of 2023: to compile a source, and for each file that it includes, itself
# or through another of ours, which says more than its length; for any other step.
OBJECT, PER_INCLUDED, OTHER = 0.8, 0.08, 0.3
# What CMake has to write again is written first. Ninja then reads its file through another, or it would
# look once more whether CMake has, and say of nothing but that what there is to do.
MANIFEST, INCLUDE = ["-f", "/dev/stdin"], "include build.ninja\n"
# The pace is trusted after as much work as this.
TRUST_S = 30.0


def output_of(description: str) -> str:
    """'Building CXX object a/b.o' and 'Linking CXX static library a/b.a' end with what they make."""
    return description.rpartition(" ")[2]


def logged_seconds(folder: Path) -> dict[str, float]:
    seconds = {}
    try:
        for line in (folder / ".ninja_log").read_text().splitlines()[1:]:
            start_ms, end_ms, _, output, _ = line.split("\t")
            seconds[output] = (int(end_ms) - int(start_ms)) / 1000
    except (OSError, ValueError):
        pass
    return seconds


@functools.cache
def included(path: Path) -> list[str]:
    try:
        return re.findall(r'^#include ["<]([^">]+)', path.read_text(errors="replace"), re.MULTILINE)
    except OSError:
        return []


def guessed_seconds(folder: Path) -> dict[str, float]:
    try:
        entries = json.loads((folder / "compile_commands.json").read_text())
    except OSError:
        return {}
    seconds = {}
    for entry in entries:
        reached, to_read = set(), [Path(entry["file"])]
        while to_read:
            news = set(included(to_read.pop())) - reached
            reached |= news
            to_read += [ROOT / name for name in news]
        output = re.search(r" -o (\S+)", entry["command"])[1]
        seconds[output] = OBJECT + PER_INCLUDED * len(reached)
    return seconds


class Estimate:
    """Of the work of `steps`, their descriptions. Times are of time.monotonic()."""

    def __init__(self, folder: Path, steps: list[str]):
        logged, guessed = logged_seconds(folder), guessed_seconds(folder)
        self._work = {}
        for step in steps:
            output = output_of(step)
            self._work[step] = logged.get(output, guessed.get(output, OTHER))
        self._left = sum(self._work.values())
        self._done = 0.0
        self._start = self._last = time.monotonic()

    def finish(self, step: str) -> None:
        work = self._work.pop(step, 0.0)
        self._left -= work
        self._done += work
        self._last = time.monotonic()

    def left_s(self) -> float:
        pace = (self._done + TRUST_S) / (self._last - self._start + TRUST_S / (os.cpu_count() or 1))
        return self._left / pace - (time.monotonic() - self._last)


def say_left(seconds: float) -> str:
    if seconds >= 90:
        return f"about {round(seconds / 60)} min left"
    if seconds >= 10:
        return f"about {round(seconds / 10) * 10} s left"
    return "nearly done"


def say_took(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


class Line:
    """The line that changes, or the lines that come every ten seconds."""

    def __init__(self):
        self._is_terminal = sys.stdout.isatty()
        self._next = 0.0

    def show(self, text: str) -> None:
        if self._is_terminal:
            print("\r" + text[: shutil.get_terminal_size().columns - 1] + "\033[K", end="", flush=True)
        elif time.monotonic() >= self._next:
            print(text, flush=True)
            self._next = time.monotonic() + 10

    def clear(self) -> None:
        if self._is_terminal:
            print("\r\033[K", end="", flush=True)

    def end(self, text: str) -> None:
        self.clear()
        print(text, flush=True)


def run(build_folder: Path, targets: list[str], what: str) -> bool:
    """Builds `targets`, all if empty. `what` begins each line of progress: 'Building 3 programs'."""
    environment = os.environ | {"NINJA_STATUS": "[%f/%t] "}
    options = {"cwd": build_folder, "env": environment, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    asked = subprocess.run(["ninja", "build.ninja"], text=True, errors="replace", **options)
    if asked.returncode == 0:
        asked = subprocess.run(["ninja", *MANIFEST, "-n", *targets], input=INCLUDE, text=True, **options)
    if asked.returncode != 0:
        print(asked.stdout, end="", flush=True)
        return False
    steps = [match[3] for match in map(STATUS.fullmatch, asked.stdout.splitlines()) if match]
    if not steps:
        print(f"{what}: nothing to do", flush=True)
        return True

    estimate, line = Estimate(build_folder, steps), Line()
    start, finished, total = time.monotonic(), 0, len(steps)
    with subprocess.Popen(["ninja", *MANIFEST, *targets], stdin=subprocess.PIPE, **options) as ninja:
        ninja.stdin.write(INCLUDE.encode())
        ninja.stdin.close()
        # By hand: a line may come in halves, and the one on the terminal changes while none comes.
        descriptor, rest, block = ninja.stdout.fileno(), b"", b"\n"
        while block:
            line.show(f"{what}: {finished} of {total}, {say_left(estimate.left_s())}")
            if not select.select([descriptor], [], [], 1)[0]:
                continue
            block = os.read(descriptor, 65536)
            *complete, rest = (rest + block).split(b"\n")
            for text in (part.decode(errors="replace") for part in complete):
                if match := STATUS.fullmatch(text):
                    finished, total = int(match[1]), int(match[2])
                    estimate.finish(match[3])
                elif text:
                    line.end(text)
    if ninja.returncode == 0:
        line.end(f"{what}: {finished} of {total}, done in {say_took(time.monotonic() - start)}")
    else:
        line.clear()
    return ninja.returncode == 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="the build folder, such as build/release")
    parser.add_argument("targets", nargs="*", help="what is built; all without it")
    parser.add_argument("--what", default="Building", help="how each line of progress begins")
    arguments = parser.parse_args()
    try:
        return 0 if run(arguments.folder, arguments.targets, arguments.what) else 1
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main())
