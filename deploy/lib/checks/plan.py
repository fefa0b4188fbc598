"""What there is to test, and what a change can reach.

CMake writes build/<preset>/tests.json (deploy/cmake/test_list.cmake): every target with the folders of its
files and what it links, and every test with the targets that it runs and the files that it reads.
"""

import json
import re
import subprocess
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

INCLUDE = re.compile(r'^\s*#include "([^"]+)"', re.MULTILINE)
# What no target compiles and no test says it reads, yet nothing built or tested depends on it.
WITHOUT_TESTS = re.compile(r"^(\.clang-format|\.clang-tidy|\.gitignore)$")
# How everything is built and tested.
REACHES_ALL = re.compile(r"^(CMakeLists\.txt|CMakePresets\.json|\.ci/|deploy/(cmake/|lib/checks/|lib/common\.sh|setup$|test$))")


@dataclass
class Test:
    name: str
    kind: str  # "gtest": a program of many tests; "script": one test
    command: list[str]
    targets: list[str]  # what has to be built
    reads: list[str] = field(default_factory=list)  # files and folders of the repository; "." is all of it
    after: list[str] = field(default_factory=list)  # tests that leave what this one begins with
    environment: dict[str, str] = field(default_factory=dict)
    timeout: float = 300  # seconds for one test
    cost: float = 1  # about how many seconds all of it takes
    skip_code: int = 77
    alone: bool = False  # nothing else runs beside it
    part: str = ""  # "web": only deploy/test --with-web runs it; "campaign": only deploy/campaign
    sanitized: str = ""  # is run a second time with sanitizers: with every "change", or in a "campaign"
    in_use: bool = False  # starts the programs, which keep the machine's time


class Plan:
    """The tests of one build folder."""

    def __init__(self, root: Path, build: Path):
        self.root = root
        data = json.loads((build / "tests.json").read_text())
        self.targets: dict[str, dict] = data["targets"]
        self.tests = {entry["name"]: Test(**entry) for entry in data["tests"]}
        for test in self.tests.values():
            test.in_use = any(name.startswith("trocar-") for name in self.needed_targets(test.targets))

    def needed_targets(self, names: list[str]) -> set[str]:
        """These targets and all that they link or start."""
        found: set[str] = set()
        waiting = list(names)
        while waiting:
            name = waiting.pop()
            if name in found or name not in self.targets:
                continue
            found.add(name)
            waiting += self.targets[name]["needs"]
        return found

    def folders_of(self, targets: set[str]) -> set[str]:
        """The folders whose files these targets are made of, included headers of tests among them."""
        folders: set[str] = set()
        for name in targets:
            folders.update(self.targets[name]["folders"])
        for name in targets:
            for source in self.targets[name]["sources"]:
                if source.startswith("tests/"):
                    folders.update(self._folders_included(source))
        return folders

    def _folders_included(self, source: str) -> set[str]:
        """Folders of the tests' own files that `source` includes, however indirectly."""
        seen = {source}
        waiting = [source]
        while waiting:
            path = self.root / waiting.pop()
            if not path.is_file():
                continue
            for name in INCLUDE.findall(path.read_text(errors="replace")):
                if name.startswith("tests/") and name not in seen:
                    seen.add(name)
                    waiting.append(name)
        return {str(Path(name).parent) for name in seen}

    @cached_property
    def test_folders(self) -> dict[str, set[str]]:
        """The folders that each test is made of."""
        return {name: self.folders_of(self.needed_targets(test.targets)) for name, test in self.tests.items()}

    def reached_by(self, changed: list[str]) -> tuple[list[str], list[str]]:
        """The names of the tests that a change of these files can reach, and the files that reach all of them.

        A file belongs to the folder that it lies in. It reaches the tests of every target that is made of
        that folder, links such a target or starts it, and the tests that say they read it. A file that
        belongs to nothing reaches everything.
        """
        folders = self.test_folders
        known = set().union(*folders.values())
        chosen: set[str] = set()
        everywhere: list[str] = []
        for path in changed:
            if WITHOUT_TESTS.match(path):
                continue
            folder = self._folder_of(path, known)
            readers = {name for name, test in self.tests.items() if any(_lies_in(path, read) for read in test.reads)}
            is_read = any(read != "." for name in readers for read in self.tests[name].reads if _lies_in(path, read))
            if REACHES_ALL.match(path) or (folder is None and not is_read):
                everywhere.append(path)
                continue
            chosen |= readers
            chosen |= {name for name, of in folders.items() if folder in of}
        if everywhere:
            chosen = set(self.tests)
        return sorted(self._with_what_they_begin_with(chosen)), everywhere

    def _with_what_they_begin_with(self, names: set[str]) -> set[str]:
        found: set[str] = set()
        waiting = list(names)
        while waiting:
            name = waiting.pop()
            if name not in found:
                found.add(name)
                waiting += self.tests[name].after
        return found

    @staticmethod
    def _folder_of(path: str, known: set[str]) -> str | None:
        """The nearest folder above `path` that a target is made of."""
        for parent in Path(path).parents:
            if str(parent) in known:
                return str(parent)
        return None


def _lies_in(path: str, place: str) -> bool:
    return place == "." or path == place or path.startswith(place.rstrip("/") + "/")


def changed_files(root: Path, base: str) -> list[str]:
    """Files that differ from commit `base`, those that git does not know yet among them."""

    def lines(*command: str) -> list[str]:
        done = subprocess.run(["git", "-C", str(root), *command], capture_output=True, text=True)
        if done.returncode:
            raise ValueError(done.stderr.strip().splitlines()[0])
        return done.stdout.splitlines()

    names = lines("diff", "--name-only", "--no-renames", base)
    return sorted(set(names + lines("ls-files", "--others", "--exclude-standard")))
