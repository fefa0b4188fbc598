"""deploy/test calls this once everything is installed."""

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import build as ninja  # deploy/lib/build.py

from . import report
from .plan import Plan, Test, changed_files
from .progress import minutes
from .runner import Job, Runner, make_jobs
from .suite import Suite

ROOT = Path(__file__).resolve().parents[3]
FUZZ_SECONDS = 3  # for each reader of outside data; deploy/campaign fuzz gives them minutes

USAGE = """deploy/test [--yes] [--all | --with-node | --with-web | --with-clang] [--changed BASE]
                   [--filter REGEX] [--campaign] [--out DIR]"""
HELP = """Sets up, builds and tests. The last line says "N passed, N failed"; the exit code is 0 only if nothing
failed. A test that starts programs and fails is tried once more, by itself; the end names it.
Reports go to ./out/test: JUnit XML, the logs of what failed, and release-times.tsv with the seconds of each test."""


def parse(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="deploy/test", usage=USAGE, description=HELP, allow_abbrev=False,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--yes", action="store_true", help="install missing packages without asking")
    parser.add_argument("--all", action="store_true", help="all that a change has to pass: also what the next three "
                        "options add, and that each header compiles alone")
    parser.add_argument("--with-node", action="store_true",
                        help="also install Node.js, for the test that reads recordings with the public library")
    parser.add_argument("--with-web", action="store_true",
                        help="also build the page for browsers, and test it in Chromium and Firefox")
    parser.add_argument("--with-clang", action="store_true", help="also build what reads outside data with clang "
                        f"and sanitizers, test it again, and give each reader {FUZZ_SECONDS} seconds of libFuzzer")
    parser.add_argument("--changed", metavar="BASE", help="only what can be reached by the files that differ from "
                        "this commit: builds and tests nothing else")
    parser.add_argument("--filter", metavar="REGEX", default="",
                        help="only the tests whose name matches, such as 'mesh' or 'cutting_test.Campaign'")
    parser.add_argument("--campaign", action="store_true",
                        help="the long tests that deploy/campaign runs, and no others")
    parser.add_argument("--out", metavar="DIR", default="out/test", help="where reports go; default out/test")
    options = parser.parse_args(arguments)
    if options.all:
        options.with_node = options.with_web = options.with_clang = True
    try:
        re.compile(options.filter)
    except re.error as error:
        parser.error(f"--filter: '{options.filter}' is no regular expression: {error}")
    return options


class Check:
    """One run: what has passed, failed and was skipped so far."""

    def __init__(self, options: argparse.Namespace):
        self.options = options
        self.out = Path(os.environ.get("TROCAR_CALLED_FROM", "."), options.out).resolve()
        self.out.mkdir(parents=True, exist_ok=True)
        self.passed = 0
        self.failures: list[str] = []
        self.skips: list[str] = []
        self.second_tries: list[str] = []
        self.began = time.monotonic()
        self.steps: list[tuple[str, float]] = []  # each with the time at which it began
        self.changed: list[str] | None = None
        self.runner: Runner | None = None

    # --- steps ---

    def step(self, text: str) -> None:
        self.steps.append((text, time.monotonic()))
        print(f"\n== {text}", flush=True)

    def command(self, name: str, command: list[str], shown: int = 60) -> bool:
        """One counted check; its output goes to a file and is shown if it fails."""
        print(f"{name:<40}", end="", flush=True)
        log = self.out / f"{name}.log"
        with log.open("w") as file:
            done = subprocess.run(command, cwd=ROOT, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT)
        if done.returncode == 0:
            print("passed", flush=True)
            self.passed += 1
            return True
        print("FAILED", flush=True)
        print("\n".join(log.read_text(errors="replace").splitlines()[-shown:]), flush=True)
        self.failures.append(name)
        return False

    def sources(self, tops: tuple[str, ...], endings: tuple[str, ...]) -> list[str]:
        """The files of a checkout below these folders, or of a copy of it; of a change only those that it has."""
        patterns = [f"{top}/*{ending}" for top in tops for ending in endings]
        names = subprocess.run(["git", "ls-files", *patterns], cwd=ROOT, capture_output=True, text=True)
        files = names.stdout.split()
        if not files:  # not a checkout
            files = [str(path.relative_to(ROOT)) for top in tops for ending in endings
                     for path in (ROOT / top).rglob(f"*{ending}")]
        if self.changed is not None:
            files = [name for name in files if name in self.changed and (ROOT / name).exists()]
        return files

    def format(self) -> None:
        self.step("Format")
        files = self.sources(("common", "server", "client", "tests"), (".h", ".cpp"))
        if files:
            (self.out / "sources").write_text("\0".join(files))
            self.command("format", ["xargs", "-0", "-P", str(os.cpu_count()), "-n", "100", "-a",
                                    str(self.out / "sources"), "clang-format", "--dry-run", "-Werror"])
        files = self.sources(("client/web/page",), (".ts", ".tsx", ".mjs", ".css", ".html"))
        if files:
            self.format_page(files)

    def format_page(self, files: list[str]) -> None:
        """Prettier comes with the other modules of the page, where its build has them."""
        modules = ROOT / "build/release/client/web/page"
        if self.options.with_web:
            code = subprocess.run([ROOT / "deploy/lib/modules", ROOT / "client/web/page", modules]).returncode
            if code == 77:
                self.skips.append("the format of the page: npm cannot reach its registry")
                return
            if code:
                self.failures.append("modules of the page")
                return
        prettier = modules / "node_modules/.bin/prettier"
        if prettier.exists():
            self.command("format-page", [str(prettier), "--check", *files])
        else:
            self.skips.append("the format of the page: --with-web was not given")

    def configure(self, preset: str) -> Plan:
        """The plan of a build folder, configured if it is not yet, or not with tests or not with the page."""
        build = ROOT / "build" / preset
        cache = build / "CMakeCache.txt"
        lines = cache.read_text() if cache.exists() else ""
        rules = (build / "build.ninja").read_text() if (build / "build.ninja").exists() else ""
        wants_page = self.options.with_web and preset == "release" and "web_page" not in rules
        if not rules or "TROCAR_TESTS:BOOL=ON" not in lines or wants_page or not (build / "tests.json").exists():
            done = subprocess.run(["cmake", "--preset", preset, "-DTROCAR_TESTS=ON"], cwd=ROOT, capture_output=True,
                                  text=True)
            if done.returncode:
                print(done.stdout + done.stderr)
                self.failures.append(f"configure {preset}")
                self.finish()
        elif subprocess.run(["ninja", "-C", str(build), "build.ninja"], stdout=subprocess.DEVNULL).returncode:
            self.failures.append(f"configure {preset}")
            self.finish()
        return Plan(ROOT, build)

    def build(self, preset: str, targets: list[str]) -> None:
        build = ROOT / "build" / preset
        before = len(report.ninja_log(build))
        if not ninja.run(build, targets, f"Building {preset}"):
            self.failures.append(f"build {preset}")
            self.finish()
        self.passed += 1
        self.longest = report.longest_outputs(build, before)

    def choose(self, plan: Plan) -> list[Test]:
        """The tests of this run."""
        tests = [test for test in plan.tests.values() if (test.part == "campaign") == self.options.campaign]
        if not self.options.with_web:
            left_out = [test.name for test in tests if test.part == "web"]
            tests = [test for test in tests if test.part != "web"]
            if left_out and not self.options.filter:
                self.skips.append(f"{len(left_out)} tests of the page in browsers: --with-web was not given")
        if self.changed is not None:
            reached, everywhere = plan.reached_by(self.changed)
            tests = [test for test in tests if test.name in reached]
            print(f"{len(self.changed)} files changed: {len(tests)} of {len(plan.tests)} programs and scripts "
                  "of tests can be reached by them")
            if everywhere:
                print(f"  ({everywhere[0]} reaches all of them)")
        return tests

    def run(self, preset: str, tests: list[Test]) -> None:
        jobs = make_jobs(tests, self.options.filter)
        if not jobs:
            if self.options.filter:
                self.failures.append(f"no test's name matches '{self.options.filter}'")
            return
        suite = Suite(jobs)
        self.runner = suite.runner
        suite.run(self.out / f"{preset}.xml")
        self.count(jobs)
        report.write_times(self.out / f"{preset}-times.tsv", jobs)
        if preset == "release":
            self.slowest = report.slowest(jobs)

    def count(self, jobs: list[Job]) -> None:
        for job in jobs:
            for result in job.results:
                name = report.full_name(job, result)
                if result.outcome == "passed":
                    self.passed += 1
                    if result.first_output:
                        self.second_tries.append(name)
                elif result.outcome == "skipped":
                    self.skips.append(f"{name}: {report.reason(result.output)}")
                else:
                    self.failures.append(name)

    # --- the whole ---

    longest: list[str] = []
    slowest: list[str] = []

    def release(self) -> Plan:
        plan = self.configure("release")
        tests = self.choose(plan)
        is_whole = self.changed is None and not self.options.filter and not self.options.campaign
        if is_whole:
            targets = ["all"]
        else:
            if self.options.filter:
                tests = [test for test in tests if self.may_match(test)]
            targets = sorted({target for test in tests for target in test.targets})
        if targets:
            self.step("Build (release)")
            self.build("release", targets)
        if self.options.all:
            self.headers(plan, tests, is_whole)
        if tests:
            self.step("Tests (release)")
            self.run("release", tests)
        return plan

    def may_match(self, test: Test) -> bool:
        """False where no test of this name can match: then it need not be built."""
        if test.kind == "script":
            return bool(re.search(self.options.filter, test.name))
        # A name from its beginning on is that of a program; others are known once it is built.
        words = re.fullmatch(r"\^(\w+)\\?\.[^|]*", self.options.filter)
        return not words or words[1] in test.name

    def headers(self, plan: Plan, tests: list[Test], is_whole: bool) -> None:
        suffix = "_verify_interface_header_sets"
        names = ["all" + suffix]
        if not is_whole:
            reached = plan.needed_targets([target for test in tests for target in test.targets])
            names = [name + suffix for name in sorted(reached) if plan.targets[name]["lone_headers"]]
        if names:
            self.step("Headers compile alone")
            self.command("headers", ["ninja", "-C", "build/release", *names])

    def sanitized(self) -> None:
        """What reads outside data, a second time."""
        plan = self.configure("clang-fuzz")
        tests = [test for test in self.choose(plan) if test.sanitized == "change"]
        if not tests:
            return
        self.step("Build (clang, address and undefined-behaviour sanitizers)")
        self.build("clang-fuzz", sorted({target for test in tests for target in test.targets}) + ["fuzz"])
        self.step("Tests (clang, sanitizers): what reads outside data")
        self.run("clang-fuzz", tests)
        if not self.options.filter:
            self.step(f"Readers (libFuzzer, {FUZZ_SECONDS} s each)")
            self.fuzz()

    def fuzz(self) -> None:
        folder = self.out / "fuzz"
        for row in folder.glob("row-*.md"):
            row.unlink()
        readers = sorted(path.name for path in (ROOT / "tests/fuzz/seeds").iterdir() if path.is_dir())
        command = f'printf "%s\\n" "$@" | xargs -P {os.cpu_count()} -I {{}} deploy/lib/fuzz {{}} {FUZZ_SECONDS} "$0"'
        if not self.command("fuzz", ["bash", "-c", command, str(folder), *readers], shown=0):
            for row in sorted(folder.glob("row-*.md")):
                if not row.read_text().rstrip().endswith(" 0 |"):
                    name = row.stem.removeprefix("row-")
                    print(f"\n{name}:\n" + "\n".join((folder / f"{name}.txt").read_text().splitlines()[-12:]))

    def times_of_steps(self) -> list[str]:
        if not self.steps:
            return []
        ends = [began for _, began in self.steps[1:]] + [time.monotonic()]
        return ["The steps took:"] + [f"  {end - began:6.0f} s  {text}"
                                      for (text, began), end in zip(self.steps, ends)]

    def finish(self) -> None:
        """Says what came of it, and ends."""
        for lines in (self.longest, self.slowest, report.cache_figures(), self.times_of_steps()):
            if lines:
                print("\n" + "\n".join(lines))
        self.step(f"Result, after {minutes(time.monotonic() - self.began)}")
        for name in self.skips:
            print(f"skipped: {name}")
        for name in self.second_tries:
            print(f"passed at the second try only, by itself: {name}")
        for name in self.failures:
            print(f"FAILED:  {name}")
        line = f"{self.passed} passed, {len(self.failures)} failed"
        if self.skips:
            line += f", {len(self.skips)} skipped"
        if self.second_tries:
            line += f", {len(self.second_tries)} at the second try only"
        print(line, flush=True)
        sys.exit(1 if self.failures else 0)


def main() -> None:
    options = parse(sys.argv[1:])
    check = Check(options)

    def interrupted(number, frame):
        if check.runner:
            check.runner.stop()
        print(f"\ndeploy/test: ended by {signal.Signals(number).name}", file=sys.stderr)
        os._exit(128 + number)

    # Those that the caller ignores would be ignored by tests, too.
    for number in (signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, interrupted)
    if shutil.which("ccache"):
        subprocess.run(["ccache", "-z"], stdout=subprocess.DEVNULL)
    if options.changed:
        try:
            check.changed = changed_files(ROOT, options.changed)
        except ValueError as error:
            print(f"deploy/test: --changed {options.changed}: {error}", file=sys.stderr)
            sys.exit(2)
    if not options.filter and not options.campaign:
        check.format()
    check.release()
    if options.with_clang and not options.campaign:
        check.sanitized()
    check.finish()


main()
