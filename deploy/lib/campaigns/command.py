"""deploy/campaign: the command line."""

import argparse
import os
import signal
import sys
import textwrap
from pathlib import Path

from parts import PARTS
from whole import run_all, share
from work import ROOT, Failed, Work

USAGE = """\
Usage: deploy/campaign NAME [--yes] [--out DIR] [--minutes N] [--organs DIR] [--cuts N] [--count N]
                       [--seed N] [--hours H] [--short]
       deploy/campaign all [--hours H] [--only NAME,NAME] [--resume] [--write] [--yes] [--out DIR]

Long checks that are not part of deploy/test. Each takes about the hours beside its name on two cores:

{parts}
  all       {hours}  all of them one after the other, and one report, report.md and report.json: goes on
                  after a part that fails, and says so at once. The last line is "N passed, N failed"

  --yes        install missing packages without asking
  --out DIR    where reports go; default ./out/campaign-NAME
  --hours H    for soak: instead of 1. For all: what {able}
               take together; without it each of them takes half of the hours above
  --only NAME,NAME  for all: only these parts
  --resume     for all: what has passed on the same commit, by the report in the folder, is not run again
  --write      for all: puts date, commit, minutes and outcome of each part into CONTRIBUTING.md
  --short      for soak: a minute
  --minutes N  for fuzz and hour: instead of 60
  --organs DIR for cuts and all: liver_tiny, liver_coarse, stomach_wall and gallbladder_wall (.msh) from
               there; what is not there is replaced by an organ that can be made
  --cuts N     for cuts: in all, instead of 10,000
  --count N    for snapshots: states in all, instead of 4,000; for faults: recordings, instead of 200
  --seed N     for snapshots: of the first session, instead of 1
  --help       this text

Examples:
  deploy/campaign all --yes --write             # a night
  deploy/campaign all --only cuts,fuzz --hours 0.5
"""
FOR_ALL = ("hours", "only", "resume", "write", "organs")


def usage() -> str:
    lines = []
    for part in PARTS.values():
        first, *others = textwrap.wrap(part.about, 86)
        lines += [f"  {part.name:<10}{part.hours:4.1f}  {first}"] + [" " * 18 + line for line in others]
    able = [part for part in PARTS.values() if part.length]
    return USAGE.format(parts="\n".join(lines), hours=f"{sum(share(list(PARTS.values()), None).values()):4.1f}",
                        able=", ".join(part.name for part in able))


class Options(argparse.ArgumentParser):
    def error(self, message):
        raise Failed(2, f"{message.removeprefix('argument ')}, see deploy/campaign --help")


def whole_number(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 up")
    return int(text)


def some_hours(text: str) -> float:
    try:
        if 0.01 <= float(text) <= 72:
            return float(text)
    except ValueError:
        pass
    raise argparse.ArgumentTypeError(f"{text!r} is not a number from 0.01 to 72")


def some_parts(text: str) -> list[str]:
    for name in text.split(","):
        if name not in PARTS:
            raise argparse.ArgumentTypeError(f"{name!r} is none of {', '.join(PARTS)}")
    return text.split(",")


def parse(words: list[str]):
    parser = Options(prog="deploy/campaign", add_help=False, allow_abbrev=False)
    parser.add_argument("name", nargs="?", metavar="NAME", choices=[*PARTS, "all"])
    for name, kind in (("out", Path), ("organs", str), ("hours", some_hours), ("minutes", whole_number),
                       ("cuts", whole_number), ("count", whole_number), ("seed", whole_number), ("only", some_parts)):
        parser.add_argument(f"--{name}", type=kind)
    for name in ("yes", "short", "resume", "write"):
        parser.add_argument(f"--{name}", action="store_true")
    options = parser.parse_args(words)
    if not options.name:
        raise Failed(2, "names no campaign, see deploy/campaign --help")
    known = FOR_ALL if options.name == "all" else PARTS[options.name].options
    for name, value in vars(options).items():
        if value and name not in ("name", "out", "yes", *known):
            raise Failed(2, f"--{name}: is not for {options.name}, see deploy/campaign --help")
    return options


def main(words: list[str]) -> int:
    if "--help" in words or not words:
        print(usage(), end="")
        return 0 if words else 2
    options = parse(words)
    options.organs = options.organs and str(Path(options.organs).resolve())
    out = (options.out or ROOT / f"out/campaign-{options.name}").resolve()
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError:
        raise Failed(5, f"{out}: cannot be made, name another with --out")
    if options.name == "all":
        return run_all(options, out)
    part = PARTS[options.name]
    if part.length and getattr(options, part.length) is None:
        setattr(options, part.length, part.amount)
    work = Work(options, out)
    work.call("deploy/setup", "--with-tests", *part.setup, *work.yes(), why="something is missing, see above")
    part.run(work)
    print(f"deploy/campaign: {part.name} found nothing.")
    return 0


if __name__ == "__main__":
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) != signal.SIG_IGN:  # as nohup wants it
            signal.signal(number, signal.default_int_handler)  # then `all` ends the part that runs
    try:
        sys.exit(main(sys.argv[1:]))
    except Failed as failure:
        print(f"deploy/campaign: {failure}", file=sys.stderr)
        sys.exit(failure.code)
    except OSError as error:
        print(f"deploy/campaign: {error}", file=sys.stderr)
        sys.exit(5)
    except KeyboardInterrupt:
        if os.getpgrp() == os.getpid():  # what it has started goes with it
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            os.killpg(0, signal.SIGTERM)
        print("\ndeploy/campaign: stopped; `all --resume` goes on from here", file=sys.stderr)
        sys.exit(130)
