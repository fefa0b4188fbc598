"""Runs tests: a program of many tests as one process, two programs at a time, what needs the machine alone last."""

import os
import re
import signal
import subprocess
import tempfile
import threading
import time
from dataclasses import dataclass, field

from .plan import Test
from .progress import Progress

# Google Test's lines. A test may have printed half a line before its own end.
BEGIN = re.compile(r"\[ RUN      \] (\S+)$")
END = re.compile(r"\[ {2}(?:     OK|FAILED|SKIPPED) {0,1} \] (\S+?)(?:, where .*)? \((\d+) ms\)$")
LISTED = re.compile(r"^( *)([^ #]+)")
SHARD_SECONDS = 600  # a program that takes longer is run as several processes
OUTPUT_LINES = 60  # shown of a test that fails


@dataclass
class Result:
    name: str
    outcome: str  # "passed", "failed" or "skipped"
    seconds: float
    output: str = ""
    first_output: str = ""  # of one that passed when it was tried again


@dataclass
class Job:
    """One process: a script, or the tests of a program, or one of several parts of them."""

    test: Test
    names: list[str]  # of its tests; of a script its own
    cost: float
    cpu_seconds: float = 0
    results: list[Result] = field(default_factory=list)


def list_tests(test: Test) -> list[str]:
    """The names of a program's tests as Suite.Name; ValueError if it cannot say them."""
    listed = subprocess.run([*test.command, "--gtest_list_tests"], capture_output=True, text=True)
    if listed.returncode:
        raise ValueError(f"{test.name}: does not list its tests: {listed.stderr.strip()[-200:]}")
    names, suite = [], ""
    for line in listed.stdout.splitlines():
        match = LISTED.match(line)
        if match and not match[1]:
            suite = match[2]
        elif match and "DISABLED_" not in suite + match[2]:
            names.append(suite + match[2])
    return names


def make_jobs(tests: list[Test], pattern: str) -> list[Job]:
    """One job or more for each test; with a pattern only the tests whose name (program.Suite.Name) has it."""
    jobs = []
    for test in tests:
        names = [test.name] if test.kind == "script" else list_tests(test)
        count = len(names)
        if pattern:
            prefix = "" if test.kind == "script" else test.name + "."
            names = [name for name in names if re.search(pattern, prefix + name)]
        if not names:
            continue
        cost = test.cost * len(names) / count
        shards = 1
        if test.kind == "gtest" and not test.alone:
            shards = min(len(names), 1 + int(cost / SHARD_SECONDS))
        for shard in range(shards):
            jobs.append(Job(test, names[shard::shards], cost / shards))
    return jobs


class Runner:
    def __init__(self, workers: int, progress: Progress):
        self.workers = workers
        self.progress = progress
        self.stopped = threading.Event()
        self._running: set[subprocess.Popen] = set()
        self._lock = threading.Lock()

    def run(self, jobs: list[Job]) -> None:
        """All of them, the longest first; then those that want the machine for themselves.

        What starts programs depends on how busy the machine is. If it fails, it is tried once more, by itself.
        A test that computes gets no second chance.
        """
        shared = sorted((job for job in jobs if not job.test.alone), key=lambda job: -job.cost)
        alone = [job for job in jobs if job.test.alone]
        names = {job.test.name for job in jobs}
        done: set[str] = set()  # names of tests whose jobs have all ended
        left = {name: sum(job.test.name == name for job in jobs) for name in names}
        change = threading.Condition()

        def next_job(waiting: list[Job]) -> Job | None:
            for job in waiting:
                if all(name in done or name not in names for name in job.test.after):
                    waiting.remove(job)
                    return job
            return None

        def work(waiting: list[Job]) -> None:
            while not self.stopped.is_set():
                with change:
                    job = next_job(waiting)
                    while job is None and waiting:
                        change.wait(1)
                        job = next_job(waiting)
                if job is None:
                    return
                self._run_job(job)
                with change:
                    left[job.test.name] -= 1
                    if left[job.test.name] == 0:
                        done.add(job.test.name)
                    change.notify_all()

        for waiting, workers in ((shared, self.workers), (alone, 1)):
            threads = [threading.Thread(target=work, args=(waiting,)) for _ in range(workers)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
        for job in jobs:
            if job.test.in_use:
                self._try_again(job)

    def _try_again(self, job: Job) -> None:
        for first in [result for result in job.results if result.outcome == "failed" and result.name in job.names]:
            if self.stopped.is_set():
                return
            self.progress.test_is_tried_again(first.name)
            again = Job(job.test, [first.name], 0)
            self._run_job(again)
            job.cpu_seconds += again.cpu_seconds
            if all(result.outcome == "passed" for result in again.results):
                first.outcome, first.first_output = "passed", first.output

    def stop(self) -> None:
        """Ends what runs."""
        self.stopped.set()
        with self._lock:
            for process in self._running:
                _kill(process)

    def _run_job(self, job: Job) -> None:
        if job.test.kind == "script":
            self._run_script(job)
            return
        # A test that ends its process, or has to be ended, must not take the others with it.
        left = list(job.names)
        while left and not self.stopped.is_set():
            self._run_program(job, left)
            ended = {result.name for result in job.results}
            left = [name for name in left if name not in ended]

    def _start(self, job: Job, command: list[str], output) -> subprocess.Popen:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT, text=True,
            errors="replace", start_new_session=True, env={**os.environ, **job.test.environment})
        with self._lock:
            self._running.add(process)
        return process

    def _reap(self, job: Job, process: subprocess.Popen) -> int:
        """The exit code, negative for a signal; counts what the process and its children have used."""
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        with self._lock:
            self._running.discard(process)
        job.cpu_seconds += usage.ru_utime + usage.ru_stime
        return process.returncode

    def _end(self, job: Job, result: Result) -> None:
        job.results.append(result)
        self.progress.test_ended(job.test.name, result, job.cost / len(job.names))

    def _run_script(self, job: Job) -> None:
        begin = time.monotonic()
        # A file, not a pipe: what a script leaves running would keep that open.
        with tempfile.TemporaryFile("w+", errors="replace") as file:
            process = self._start(job, job.test.command, file)
            clock = _Clock(process, job.test.timeout)
            code = self._reap(job, process)
            clock.cancel()
            file.seek(0)
            output = file.read()
        seconds = time.monotonic() - begin
        if clock.has_struck:
            output += f"\nIt took longer than {job.test.timeout:.0f} s and was ended."
            code = 1
        outcome = {0: "passed", job.test.skip_code: "skipped"}.get(code, "failed")
        self._end(job, Result(job.test.name, outcome, seconds, output))

    def _run_program(self, job: Job, names: list[str]) -> None:
        process = self._start(job, [*job.test.command, "--gtest_color=no", "--gtest_filter=" + ":".join(names)],
                              subprocess.PIPE)
        current, lines, begin = None, [], time.monotonic()
        clock = _Clock(process, job.test.timeout)
        for line in process.stdout:
            line = line.rstrip("\n")
            if match := BEGIN.search(line):
                current, lines, begin = match[1], [], time.monotonic()
                clock.restart()
            elif current and (match := END.search(line)) and match[1] == current:
                word = line[match.start():]
                outcome = "passed" if "OK" in word else "skipped" if "SKIPPED" in word else "failed"
                self._end(job, Result(current, outcome, int(match[2]) / 1000, "\n".join(lines)))
                current = None
                clock.restart()
            else:
                lines.append(line)
        process.stdout.close()
        code = self._reap(job, process)
        clock.cancel()
        if self.stopped.is_set():
            return
        why = f"It took longer than {job.test.timeout:.0f} s and was ended." if clock.has_struck else _death(code)
        if current is None:
            # It ended between two tests, or before the first; otherwise it would be started for ever.
            missing = [name for name in names if name not in {result.name for result in job.results}]
            if not missing:
                if code not in (0, 1):
                    self._end(job, Result(job.test.name + " (at its end)", "failed", 0, "\n".join([*lines, why])))
                return
            current = missing[0]
        self._end(job, Result(current, "failed", time.monotonic() - begin, "\n".join([*lines, why])))


class _Clock:
    """Ends a process whose test takes too long."""

    def __init__(self, process: subprocess.Popen, seconds: float):
        self._process, self._seconds = process, seconds
        self.has_struck = False
        self._timer: threading.Timer | None = None
        self.restart()

    def restart(self) -> None:
        self.cancel()
        self._timer = threading.Timer(self._seconds, self._strike)
        self._timer.daemon = True
        self._timer.start()

    def cancel(self) -> None:
        if self._timer:
            self._timer.cancel()

    def _strike(self) -> None:
        self.has_struck = True
        _kill(self._process)


def _kill(process: subprocess.Popen) -> None:
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass


def _death(code: int) -> str:
    if code < 0:
        return f"Its process was ended by {signal.Signals(-code).name}."
    return f"Its process ended with exit code {code}."


def shown(result: Result) -> str:
    """The end of a failed test's output."""
    lines = result.output.strip().splitlines()
    return "\n".join(lines[-OUTPUT_LINES:])
