"""suite.py BUILD_FOLDER [--sanitized] --out DIR: all tests of a build, or those that are run with sanitizers.

Its report is JUnit XML; the exit code is 1 if a test failed.
"""

import argparse
import os
import sys
import time
from pathlib import Path

from . import report
from .plan import Plan
from .progress import Progress, minutes
from .runner import Job, Runner, make_jobs


class Suite:
    """Jobs that are run once, with progress."""

    def __init__(self, jobs: list[Job]):
        self.jobs = jobs
        workers = os.cpu_count() or 1
        self.progress = Progress(sum(len(job.names) for job in jobs), sum(job.cost for job in jobs), workers)
        self.runner = Runner(workers, self.progress)

    def run(self, junit: Path) -> None:
        began = time.monotonic()
        print(f"{self.progress.tests:,} tests in {len(self.jobs)} processes, "
              f"about {minutes(self.progress.seconds_left(began))}", flush=True)
        self.runner.run(self.jobs)
        print(f"{self.progress.ended:,} tests in {minutes(time.monotonic() - began)}", flush=True)
        report.write_junit(junit, self.jobs)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("build", type=Path)
    parser.add_argument("--sanitized", action="store_true")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    root = Path(__file__).resolve().parents[3]
    tests = Plan(root, root / options.build).tests.values()
    jobs = make_jobs([test for test in tests if test.sanitized or not options.sanitized], "")
    suite = Suite(jobs)
    suite.run(options.out / f"{options.build.name}.xml")
    return 1 if any(result.outcome == "failed" for job in jobs for result in job.results) else 0


if __name__ == "__main__":
    sys.exit(main())
