"""Whether tests find mistakes: each of tests/mutants/mutants.toml is made in a clone, and what its change reaches
is built and run, the nearest tests first, until one fails. Only tests of `deploy/test` count."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

from work import ROOT, Failed

sys.path.insert(0, str(ROOT / "deploy/lib"))
from checks.plan import Plan  # noqa: E402

LONGEST_S = 900  # for one program of tests


def load(file: Path) -> list[dict]:
    """The mistakes; Failed if one of them cannot be made any more."""
    mutants = tomllib.loads(file.read_text())["mutant"]
    for mutant in mutants:
        count = (ROOT / mutant["file"]).read_text().count(mutant["old"])
        if count != 1:
            raise Failed(3, f"{file}: {mutant['file']} has {count} times what the mistake changes, must be once")
    return mutants


def nearest_tests(plan: Plan, file: str) -> list[str]:
    """The programs of tests that a change of the file reaches, those of the fewest folders first."""
    names = [name for name in plan.reached_by([file])[0]
             if plan.tests[name].kind == "gtest" and not plan.tests[name].part and not plan.tests[name].alone]
    return sorted(names, key=lambda name: (len(plan.test_folders[name]), name))


def find(work, tree: Path, plan: Plan, mutant: dict) -> str:
    """The first program of tests that fails with this mistake; empty if none does."""
    file = tree / mutant["file"]
    right = file.read_text()
    file.write_text(right.replace(mutant["old"], mutant["new"]))
    try:
        for name in nearest_tests(plan, mutant["file"]):
            if name == "architecture_test":
                continue
            work.call("ninja", "-C", f"{tree}/build/release", name, to="build.txt",
                      why=f"{mutant['file']}: '{mutant['mistake']}' does not compile")
            test = plan.tests[name]
            with (work.out / f"{name}.txt").open("w") as said:
                try:
                    done = subprocess.run(test.command, stdout=said, stderr=said, timeout=LONGEST_S,
                                          env={**os.environ, **test.environment}).returncode
                except subprocess.TimeoutExpired:
                    done = 1
            if done != 0:
                return name
        return ""
    finally:
        file.write_text(right)


def run(work) -> None:
    mutants = load(ROOT / "tests/mutants/mutants.toml")
    tree = work.out / "tree"
    if not tree.exists():
        work.call("git", "clone", "--quiet", "--shared", str(ROOT), str(tree))
    work.call("git", "-C", str(tree), "pull", "--quiet", "--ff-only", codes=range(256))
    work.call("git", "-C", str(tree), "checkout", "--quiet", "--force", "HEAD")
    work.call("bash", "-c", 'cd "$0" && . deploy/lib/common.sh && cmake --preset release -DTROCAR_TESTS=ON', str(tree),
              to="configure.txt")
    os.environ.update(CCACHE_BASEDIR=str(tree), CCACHE_NOHASHDIR="1")
    plan = Plan(tree, tree / "build/release")
    lines, missed = ["| file | mistake | found by |\n|---|---|---|\n"], []
    for mutant in mutants:
        name = find(work, tree, plan, mutant)
        missed += [] if name else [mutant]
        lines.append(f"| `{mutant['file']}` | {mutant['mistake']} | {f'`{name}`' if name else 'nothing'} |\n")
        print(lines[-1], end="", flush=True)
        (work.out / "table.md").write_text("".join(lines))
    if missed:
        raise Failed(1, f"{len(missed)} of {len(mutants)} mistakes are found by no test, see {work.out}/table.md")
