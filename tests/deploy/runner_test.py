"""How deploy/test runs programs: what ends early, hangs or lies must be one failed test, and no other is lost."""

import os
import stat
import sys
import tempfile
import textwrap
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "deploy/lib"))
from checks.plan import Test  # noqa: E402
from checks.runner import Runner, make_jobs  # noqa: E402

# Speaks as Google Test does: lists its tests, and runs those of the filter.
PROGRAM = """#!/usr/bin/env python3
import os, signal, sys, time
TESTS = {tests!r}
chosen = [a.split("=", 1)[1].split(":") for a in sys.argv if a.startswith("--gtest_filter=")]
if "--gtest_list_tests" in sys.argv:
    print("Running main() from somewhere.")
    suite = None
    for name in TESTS:
        if name.split(".")[0] != suite:
            suite = name.split(".")[0]
            print(suite + ".")
        print("  " + name.split(".")[1] + "  # GetParam() = 3")
    sys.exit(0)
for name in chosen[0]:
    kind = TESTS[name]
    print("[ RUN      ] " + name, flush=True)
    if kind == "dies":
        os.kill(os.getpid(), signal.SIGSEGV)
    if kind == "leaves":
        sys.exit(0)
    if kind == "hangs":
        time.sleep(60)
    if kind == "fails":
        print("a.cpp:3: Failure\\nExpected: 1")
    if kind == "skips":
        print("a.cpp:3: Skipped\\nno device")
    word = {{"fails": "[  FAILED  ]", "skips": "[  SKIPPED ]"}}.get(kind, "[       OK ]")
    more = ", where GetParam() = 3" if kind == "fails" else ""
    print("half a line" + word + " " + name + more + " (7 ms)", flush=True)
sys.exit({code})
"""


class Quiet:
    def __init__(self):
        self.heard = []

    def test_ended(self, program, result, cost):
        self.heard.append(result.name)

    def test_is_tried_again(self, name):
        self.heard.append("again " + name)


class Running(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def program(self, name, tests, code=0, **more):
        path = self.folder / name
        path.write_text(PROGRAM.format(tests=tests, code=code))
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
        return Test(name=name, kind="gtest", command=[sys.executable, str(path)], targets=[name], **more)

    def script(self, name, text, **more):
        return Test(name=name, kind="script", command=["bash", "-c", textwrap.dedent(text)], targets=[], **more)

    def run_all(self, *tests, pattern="", workers=2):
        jobs = make_jobs(list(tests), pattern)
        quiet = Quiet()
        Runner(workers, quiet).run(jobs)
        results = {f"{job.test.name}:{result.name}": result for job in jobs for result in job.results}
        self.assertEqual(len(results), sum(len(job.results) for job in jobs), "a test has two results")
        return results, jobs

    def outcomes(self, *tests, **more):
        return {name: result.outcome for name, result in self.run_all(*tests, **more)[0].items()}

    def test_each_test_has_its_own_outcome(self):
        program = self.program("p", {"A.One": "ok", "A.Two/0": "fails", "B.Three": "skips"}, code=1)
        self.assertEqual(self.outcomes(program), {"p:A.One": "passed", "p:A.Two/0": "failed", "p:B.Three": "skipped"})

    def test_a_test_that_dies_or_leaves_takes_no_other_with_it(self):
        program = self.program("p", {"A.One": "ok", "A.Two": "dies", "A.Three": "ok", "A.Four": "leaves", "A.Five": "ok"})
        results, _ = self.run_all(program)
        self.assertEqual([result.outcome for result in results.values()],
                         ["passed", "failed", "passed", "failed", "passed"])
        self.assertIn("SIGSEGV", results["p:A.Two"].output)
        self.assertIn("exit code 0", results["p:A.Four"].output)

    def test_a_test_that_hangs_is_ended(self):
        program = self.program("p", {"A.One": "hangs", "A.Two": "ok"}, timeout=1)
        results, _ = self.run_all(program)
        self.assertEqual([result.outcome for result in results.values()], ["failed", "passed"])
        self.assertIn("longer than 1 s", results["p:A.One"].output)

    def test_a_program_that_fails_though_its_tests_pass_is_a_failure(self):
        program = self.program("p", {"A.One": "ok"}, code=3)
        self.assertEqual(self.outcomes(program), {"p:A.One": "passed", "p:p (at its end)": "failed"})

    def test_a_long_program_is_run_in_parts_that_together_are_the_whole(self):
        tests = {f"A.T{i}": "ok" for i in range(7)}
        results, jobs = self.run_all(self.program("p", tests, cost=1300))
        self.assertEqual(len(jobs), 3)
        self.assertEqual({name.removeprefix("p:") for name in results}, set(tests))

    def test_a_pattern_chooses_by_the_whole_name(self):
        program = self.program("p", {"A.One": "ok", "A.Two": "ok"})
        self.assertEqual(set(self.outcomes(program, self.script("q.One", "true"), pattern="One")),
                         {"p:A.One", "q.One:q.One"})
        self.assertEqual(set(self.outcomes(program, pattern=r"^p\.A\.T")), {"p:A.Two"})

    def test_scripts_say_by_their_exit_code(self):
        tests = [self.script("good", "true"), self.script("bad", "echo why; exit 3"),
                 self.script("away", "echo SKIPPED: no display; exit 77"), self.script("slow", "sleep 60", timeout=1)]
        results, _ = self.run_all(*tests)
        self.assertEqual({name: result.outcome for name, result in results.items()},
                         {"good:good": "passed", "bad:bad": "failed", "away:away": "skipped", "slow:slow": "failed"})
        self.assertEqual(results["bad:bad"].output, "why\n")

    def test_what_a_script_leaves_running_does_not_hold_it_up(self):
        self.assertEqual(self.outcomes(self.script("s", "sleep 60 & true", timeout=20)), {"s:s": "passed"})

    def test_nothing_runs_beside_what_wants_the_machine_alone(self):
        note = self.folder / "note"
        text = f"echo begin $0 >>{note}; sleep 0.2; echo end $0 >>{note}"
        tests = [self.script("alone", text, alone=True), self.script("one", text), self.script("two", text)]
        self.run_all(*tests)
        lines = [line.split()[0] for line in note.read_text().splitlines()]
        self.assertEqual(lines[-2:], ["begin", "end"])
        self.assertEqual(lines[:2], ["begin", "begin"], "the others run beside each other")

    def test_a_test_waits_for_what_it_begins_with(self):
        made = self.folder / "made"
        tests = [self.script("reader", f"cat {made}", after=["writer"], cost=9),
                 self.script("writer", f"sleep 0.3; echo it >{made}")]
        self.assertEqual(self.outcomes(*tests), {"reader:reader": "passed", "writer:writer": "passed"})

    def test_what_starts_programs_is_tried_once_more_by_itself_and_what_computes_is_not(self):
        def second(name):  # passes from the second time on
            return f"echo busy; test -e {self.folder}/{name} || {{ touch {self.folder}/{name}; exit 1; }}"

        tests = [self.script("use", second("a"), in_use=True), self.script("sum", second("b")),
                 self.script("broken", "exit 1", in_use=True),
                 self.program("p", {"A.One": "ok", "A.Two": "fails"}, code=1, in_use=True)]
        results, _ = self.run_all(*tests)
        self.assertEqual({name: result.outcome for name, result in results.items()},
                         {"use:use": "passed", "sum:sum": "failed", "broken:broken": "failed", "p:A.One": "passed",
                          "p:A.Two": "failed"})
        self.assertEqual(results["use:use"].first_output, "busy\n")
        self.assertFalse(results["p:A.One"].first_output)

    def test_a_program_that_cannot_list_its_tests_says_so(self):
        broken = Test(name="b", kind="gtest", command=["false"], targets=[])
        with self.assertRaisesRegex(ValueError, "b: does not list its tests"):
            make_jobs([broken], "")

    def test_the_environment_of_a_test_is_its_own(self):
        self.assertEqual(self.outcomes(self.script("s", '[ "$TROCAR_X" = 3 ]', environment={"TROCAR_X": "3"})),
                         {"s:s": "passed"})
        self.assertNotIn("TROCAR_X", os.environ)


if __name__ == "__main__":
    unittest.main()
