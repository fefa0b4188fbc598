"""deploy/campaign all: one part after the other, each in a process of its own with a log, and one report."""

import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

from parts import PARTS
from record import Outcome, Record, commit, last_lines, write_latest
from work import ROOT, Failed


def share(parts: list, hours: float | None) -> dict[str, float]:
    """How many hours each part takes, if those that can be shortened have so many together, or half of their own."""
    able = sum(part.hours for part in parts if part.length)
    scale = hours / able if hours and able else 0.5
    return {part.name: part.hours * (scale if part.length else 1) for part in parts}


def run_part(part, hours: float, options, folder: Path) -> Outcome:
    command = [str(ROOT / "deploy/campaign"), part.name, "--out", str(folder)]
    command += ["--yes"] if options.yes else []
    command += [f"--{part.length}", part.amount_for(hours)] if part.length else []
    command += ["--organs", options.organs] if options.organs and "organs" in part.options else []
    folder.mkdir(parents=True, exist_ok=True)
    outcome, begin, limit = Outcome(part.name, commit()), time.monotonic(), 4 * hours + 1
    with open(folder / "log.txt", "w") as log:
        program = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True)
        try:
            outcome.passed = program.wait(limit * 3600) == 0
        except subprocess.TimeoutExpired:
            log.write(f"\ndeploy/campaign: {part.name} was ended, not done after {limit:.1f} hours\n")
        finally:
            end(program)
    outcome.minutes = (time.monotonic() - begin) / 60
    outcome.said = (last_lines(folder / "log.txt", 1) or [""])[0]
    return outcome


def end(program) -> None:
    """Ends a part and all that it has started."""
    for number, seconds in ((signal.SIGTERM, 20), (signal.SIGKILL, 5)):
        try:
            os.killpg(program.pid, number)
            program.wait(seconds)
        except ProcessLookupError:
            return
        except subprocess.TimeoutExpired:
            pass


def run_all(options, out: Path) -> int:
    parts = [PARTS[name] for name in PARTS if not options.only or name in options.only]
    record, now, page = Record(out, options.resume), commit(), ROOT / "CONTRIBUTING.md"
    others = [outcome.name for outcome in record.outcomes.values() if outcome.commit != now]
    if others:
        raise Failed(2, f"--resume: {', '.join(others)} ran on another commit than {now}: leave --resume out")
    waiting = [part for part in parts if part.name not in record.passed()]
    for part in waiting if not options.resume else []:
        if not part.keeps:
            shutil.rmtree(out / part.name, ignore_errors=True)
    wanted = sorted({option for part in waiting for option in part.setup})
    if subprocess.call([ROOT / "deploy/setup", "--with-tests", *wanted, *(["--yes"] if options.yes else [])]):
        raise Failed(5, "something is missing, see above")
    hours = share(waiting, options.hours)
    print(f"deploy/campaign: {len(waiting)} of {len(PARTS)} parts, about {sum(hours.values()):.1f} hours on two cores; "
          f"what each says goes to {out}/NAME/log.txt", flush=True)
    for number, part in enumerate(waiting, 1):
        print(f"[{number}/{len(waiting)}] {part.name:<10} about {60 * hours[part.name]:.0f} min: ", end="", flush=True)
        outcome = run_part(part, hours[part.name], options, out / part.name)
        record.add(outcome)
        print(f"passed, {outcome.minutes:.0f} min" if outcome.passed else
              f"FAILED, {outcome.minutes:.0f} min: {outcome.said}\n    see {out / part.name}/log.txt", flush=True)
    if options.write:
        write_latest(page, record.outcomes)
        print(f"deploy/campaign: {page.name} has the table of the latest runs")
    print(f"deploy/campaign: the report is {out}/report.md\n{record.count()}")
    return 0 if all(outcome.passed for outcome in record.outcomes.values()) else 1
