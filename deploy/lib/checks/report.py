"""What a run leaves: JUnit XML, and where its minutes went."""

import shutil
import subprocess
import xml.etree.ElementTree as xml
from pathlib import Path

from .runner import Job, Result

SLOWEST_TESTS = 40
SLOWEST_PROGRAMS = 10
LONGEST_OUTPUTS = 10


def full_name(job: Job, result: Result) -> str:
    """program.Suite.Test, or the name of a script."""
    return result.name if job.test.kind == "script" else f"{job.test.name}.{result.name}"


def write_junit(path: Path, jobs: list[Job]) -> None:
    root = xml.Element("testsuites")
    suites: dict[str, xml.Element] = {}
    for job in jobs:
        suite = suites.setdefault(job.test.name, xml.SubElement(root, "testsuite", name=job.test.name))
        for result in job.results:
            case = xml.SubElement(suite, "testcase", classname=job.test.name, name=full_name(job, result),
                                  time=f"{result.seconds:.3f}")
            if result.outcome != "passed":
                kind = "failure" if result.outcome == "failed" else "skipped"
                xml.SubElement(case, kind).text = _printable(result.output)
            elif result.first_output:  # as Surefire calls it
                xml.SubElement(case, "flakyFailure").text = _printable(result.first_output)
    xml.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _printable(text: str) -> str:
    """XML knows no control characters."""
    return "".join(letter for letter in text if letter >= " " or letter in "\n\t")


def write_times(path: Path, jobs: list[Job]) -> None:
    """Every test with its seconds, and every process with those of the processor."""
    rows = ["test\twall_s\tprocess_cpu_s"]
    for job in jobs:
        for result in job.results:
            rows.append(f"{full_name(job, result)}\t{result.seconds:.3f}\t{job.cpu_seconds:.2f}")
    path.write_text("\n".join(rows) + "\n")


def slowest(jobs: list[Job]) -> list[str]:
    """Lines: the tests that took longest, and the programs that used the processor longest."""
    results = [(result.seconds, full_name(job, result)) for job in jobs for result in job.results]
    lines = [f"The slowest {SLOWEST_TESTS} tests:"]
    for seconds, name in sorted(results, reverse=True)[:SLOWEST_TESTS]:
        lines.append(f"  {seconds:7.1f} s  {name}")
    programs: dict[str, list[float]] = {}
    for job in jobs:
        sums = programs.setdefault(job.test.name, [0, 0])
        sums[0] += job.cpu_seconds
        sums[1] += sum(result.seconds for result in job.results)
    lines.append(f"The {SLOWEST_PROGRAMS} programs that used the processor longest:")
    for name, (cpu, wall) in sorted(programs.items(), key=lambda item: -item[1][0])[:SLOWEST_PROGRAMS]:
        lines.append(f"  {cpu:7.1f} s of the processor in {wall:.1f} s  {name}")
    return lines


def longest_outputs(build: Path, since_line: int) -> list[str]:
    """Lines: what took longest to build, of what .ninja_log has from that line on."""
    steps: dict[str, float] = {}
    for line in ninja_log(build)[since_line:]:
        fields = line.split("\t")
        if len(fields) == 5:
            steps[fields[3]] = (int(fields[1]) - int(fields[0])) / 1000
    lines = [f"The {LONGEST_OUTPUTS} longest of {len(steps)} outputs of build/{build.name}, "
             f"{sum(steps.values()):.0f} s in all:"]
    for name, seconds in sorted(steps.items(), key=lambda item: -item[1])[:LONGEST_OUTPUTS]:
        lines.append(f"  {seconds:7.1f} s  {name}")
    return lines if steps else []


def ninja_log(build: Path) -> list[str]:
    log = build / ".ninja_log"
    return log.read_text().splitlines() if log.exists() else []


def cache_figures() -> list[str]:
    """Lines of ccache's own figures."""
    if not shutil.which("ccache"):
        return []
    done = subprocess.run(["ccache", "-s"], capture_output=True, text=True)
    return ["The compiler's cache, since its figures were set to zero:",
            *("  " + line for line in done.stdout.splitlines()[:8])]


def reason(output: str) -> str:
    """Why a test was skipped: Google Test says it on the lines after "Skipped", a script after "SKIPPED:"."""
    lines = output.splitlines()
    for number, line in enumerate(lines):
        if "SKIPPED: " in line:
            return line.split("SKIPPED: ", 1)[1]
        if line.endswith(": Skipped"):
            return next((text for text in lines[number + 1:] if text.strip()), "no reason given")
    return "no reason given"
