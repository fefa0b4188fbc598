#!/usr/bin/env python3
"""deploy/campaign: its command line, how `all` goes on, and its tables. Nothing is built."""

import contextlib
import io
import json
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "deploy/lib/campaigns"))
sys.dont_write_bytecode = True

import command
import places
import record
import whole
from parts import PARTS
from record import Outcome
from work import Failed, Work, suite_table

CASES = """<testsuite tests="4" failures="1">
<testcase name="soak.short" classname="x" time="40.5" status="run"><system-out>
a &lt;failure in words</system-out></testcase>
<testcase classname="a_test" name="a_test.One.&lt;one&gt;" time="1.25"><failure>Failed</failure></testcase>
<testcase classname="a_test" name="a_test.One.two" time="2.5" />
<testcase name="claims_model" time="0"><skipped>SKIPPED: spin is missing</skipped></testcase></testsuite>"""


class CommandLine(unittest.TestCase):
    def test_help_names_every_part_in_lines_that_fit(self):
        text = subprocess.check_output([ROOT / "deploy/campaign", "--help"], text=True)
        for name in [*PARTS, "all"]:
            self.assertRegex(text, rf"(?m)^  {name} ")
        self.assertLessEqual(max(map(len, text.splitlines())), 105)

    def test_mistakes_are_refused_in_one_line_that_names_the_option(self):
        for words, named in ((["cuts", "--minutes", "3"], "--minutes"), (["nonsense"], "nonsense"),
                             (["--yes"], "campaign"), (["fuzz", "--minutes", "0"], "--minutes"),
                             (["soak", "--hours", "73"], "--hours"), (["all", "--only", "cuts,sok"], "'sok'"),
                             (["cuts", "--cuts"], "--cuts")):
            with self.assertRaises(Failed, msg=words) as refused:
                command.parse(words)
            self.assertEqual(refused.exception.code, 2)
            self.assertIn(named, str(refused.exception))
            self.assertRegex(str(refused.exception), "^[^\n]*, see deploy/campaign --help$")

    def test_options_of_a_part_are_read(self):
        options = command.parse(["soak", "--hours", "0.5", "--out", "x"])
        self.assertEqual((options.name, options.hours, options.out), ("soak", 0.5, Path("x")))
        self.assertEqual(command.parse(["all", "--only", "cuts,fuzz"]).only, ["cuts", "fuzz"])

    def test_what_is_wrong_is_one_line_and_a_code(self):
        done = subprocess.run([ROOT / "deploy/campaign", "nonsense"], capture_output=True, text=True)
        self.assertEqual((done.returncode, done.stdout, done.stderr.count("\n")), (2, "", 1))


class Whole(unittest.TestCase):
    """`all` with parts that only pretend."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.out = Path(folder.name)
        self.ran = []
        for patch in (mock.patch("whole.subprocess.call", return_value=0), mock.patch("whole.run_part", self.pretend),
                      mock.patch("whole.commit", lambda: self.commit)):
            patch.start()
            self.addCleanup(patch.stop)
        self.commit, self.stops_at = "abc", None

    def pretend(self, part, hours, options, folder):
        if part.name == self.stops_at:
            raise KeyboardInterrupt
        self.ran.append(part.name)
        folder.mkdir(exist_ok=True)
        (folder / part.table).write_text("# Table\n\n| of | it |\n")
        return Outcome(part.name, self.commit, minutes=2, passed=part.name != "cuts", said="a law is broken")

    def run_all(self, resume=False):
        options = SimpleNamespace(only=["cuts", "soak", "fuzz"], resume=resume, hours=None, yes=True, write=False,
                                  organs=None)
        with contextlib.redirect_stdout(io.StringIO()) as said:
            code = whole.run_all(options, self.out)
        return code, said.getvalue()

    def test_it_goes_on_after_a_part_that_fails(self):
        code, said = self.run_all()
        self.assertEqual((code, self.ran), (1, ["cuts", "soak", "fuzz"]))
        self.assertIn("FAILED, 2 min: a law is broken", said)
        self.assertEqual(said.splitlines()[-1], "2 passed, 1 failed")
        report = (self.out / "report.md").read_text()
        self.assertIn("2 passed, 1 failed", report)
        self.assertIn("| `cuts` |", report)
        self.assertIn("### Table\n\n| of | it |", report)

    def test_it_goes_on_where_it_was_stopped(self):
        self.stops_at = "fuzz"
        self.assertRaises(KeyboardInterrupt, self.run_all)
        self.stops_at, self.ran = None, []
        code, said = self.run_all(resume=True)
        self.assertEqual((code, self.ran), (1, ["cuts", "fuzz"]))  # one that failed has another try
        self.assertEqual(said.splitlines()[-1], "2 passed, 1 failed")

    def test_results_of_another_commit_are_not_taken_for_ones_of_this(self):
        self.run_all()
        self.commit = "def"
        with self.assertRaises(Failed) as refused:
            self.run_all(resume=True)
        self.assertIn("another commit than def", str(refused.exception))
        self.run_all()
        self.assertEqual(len(self.ran), 6)

    def test_a_new_run_begins_anew_but_keeps_what_readers_have_learnt(self):
        for name in ("cuts", "fuzz"):
            (self.out / name).mkdir()
            (self.out / name / "old").touch()
        self.run_all()
        self.assertFalse((self.out / "cuts/old").exists())
        self.assertTrue((self.out / "fuzz/old").exists())

    def test_the_budget_is_for_the_parts_that_can_be_shortened(self):
        hours = whole.share(list(PARTS.values()), 2)
        able = [part for part in PARTS.values() if part.length]
        self.assertAlmostEqual(sum(hours[part.name] for part in able), 2)
        self.assertEqual(hours["tsan"], PARTS["tsan"].hours)
        self.assertEqual(PARTS["fuzz"].amount_for(0.5), "30")
        self.assertEqual(PARTS["soak"].amount_for(0.001), "0.01")
        self.assertEqual(PARTS["cuts"].amount_for(1e-9), "1")

    def test_half_lengths_still_give_all_readers_ten_minutes(self):
        self.assertGreaterEqual(int(PARTS["fuzz"].amount_for(whole.share(list(PARTS.values()), None)["fuzz"])), 10)


class Parts(unittest.TestCase):
    def test_tests_fail_with_their_report_or_with_their_program(self):
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
            for case, code, said in (("<failure/>", 0, "1 tests failed"), ("<failure/>", 1, "1 tests failed"),
                                     ("", 1, "bash ended with 1"), ("", 0, None)):
                script = f'echo "<testcase name=\'a.b.c\' time=\'1\'>{case}" | tr "\'" \'"\' >"$2/x.xml"; exit {code}'
                tests = lambda: Work(None, Path(folder)).run_tests("bash", "-c", script, "x")
                if said:
                    self.assertRaisesRegex(Failed, said, tests)
                else:
                    tests()

    def test_a_part_that_does_not_end_is_ended_with_all_it_started(self):
        program = subprocess.Popen(["bash", "-c", "sleep 60 & sleep 60"], stdout=subprocess.PIPE,
                                   start_new_session=True)
        begin = time.monotonic()
        whole.end(program)
        program.communicate()  # the pipe's end, when nobody holds it any more
        self.assertLess(time.monotonic() - begin, 15)


class Tables(unittest.TestCase):
    def test_a_table_of_tests_counts_each_kind_and_names_what_did_not_pass(self):
        text, failed = suite_table([CASES])
        self.assertEqual(failed, 1)
        self.assertIn("2 passed, 1 failed, 1 skipped.", text)
        self.assertIn("- failed: `a_test.One.<one>`\n- skipped: `claims_model`\n", text)
        self.assertIn("| `soak.short` | 40.5 |\n| `a_test` | 3.8 |\n", text)

    def test_no_test_at_all_is_a_failure(self):
        self.assertEqual(suite_table([]), ("No test ran.\n", 1))

    def test_the_latest_runs_keep_rows_of_other_parts(self):
        with tempfile.TemporaryDirectory() as folder:
            page = Path(folder) / "page.md"
            page.write_text(f"Before.\n{record.BEGIN}{record.HEAD}{record.END}After.\n")
            record.write_latest(page, {"cuts": Outcome("cuts", "abc", "2026-01-02 03:04", 2, 29.6, True)})
            record.write_latest(page, {"soak": Outcome("soak", "def", "2026-02-03 04:05", 4, 61, False)})
            text = page.read_text()
        self.assertIn("| `cuts` | 2026-01-02 03:04 | `abc` | 2 | 30 | passed |\n", text)
        self.assertIn("| `soak` | 2026-02-03 04:05 | `def` | 4 | 61 | failed |\n", text)
        self.assertEqual(text.count("\n| `"), len(PARTS))
        self.assertTrue(text.startswith("Before.\n") and text.endswith("After.\n"))

    def test_the_page_has_a_place_for_them_with_each_part_in_it(self):
        table = (ROOT / "CONTRIBUTING.md").read_text().split(record.BEGIN)[1].split(record.END)[0]
        self.assertEqual([line.split("|")[1].strip(" `") for line in table.splitlines()[2:]], list(PARTS))


class Places(unittest.TestCase):
    PAGE = """# Page

## Which test runs where

| test | runs in | why |
|---|---|---|
| all others | `deploy/test` | |
| `soak.short`, `gone` | `deploy/campaign tests` | long |
| `a_test` | `deploy/campaign tests` | |

## Next

| `b_test` | `deploy/campaign tests` |
"""

    def test_it_finds_what_is_missing_what_is_too_much_and_what_does_not_exist(self):
        tests = [{"name": name, "part": "campaign"} for name in ("soak.short", "b_test")]
        tests.append({"name": "a_test", "part": ""})
        found = places.faults(self.PAGE, tests)
        self.assertEqual(len(found), 3, found)
        for fault, words in zip(found, ("b_test is marked CAMPAIGN, but not named", "a_test is named, but not marked",
                                        "gone is named, but there is no such test")):
            self.assertIn(words, fault)

    def test_a_page_without_the_table_is_a_fault(self):
        self.assertEqual(len(places.faults("# Page\n", [])), 1)

    def test_the_command_line(self):
        with tempfile.TemporaryDirectory() as folder:
            page, tests = Path(folder) / "page.md", Path(folder) / "tests.json"
            page.write_text(self.PAGE)
            whole = {"tests": [{"name": name, "part": "campaign"} for name in ("soak.short", "gone", "a_test")]}
            for text, code in (('{"tests": []}', 1), ("{", 3), (json.dumps(whole), 0)):
                tests.write_text(text)
                with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
                    self.assertEqual(places.main([str(page), str(tests)]), code, text)


if __name__ == "__main__":
    unittest.main()
