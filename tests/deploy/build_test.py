"""deploy/lib/build.py: what it says of a build that goes well, fails, or has nothing to do."""
import contextlib
import io
import os
import pty
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "deploy/lib"))
import build  # noqa: E402

NINJA = """
rule again
  command = true
  generator = 1
build build.ninja: again
rule object
  command = echo $words && touch $out
  description = Building CXX object $out
rule fault
  command = seq 500 && echo last words && exit 1
build large.o: object
  words = a remark
build small.o: object
  words = another
build program: phony large.o small.o
build broken: fault
"""


class Build(unittest.TestCase):
    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.folder = Path(place.name)
        (self.folder / "build.ninja").write_text(NINJA)

    def run_build(self, *targets):
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            is_built = build.run(self.folder, list(targets), "Building 1 program")
        return is_built, said.getvalue().splitlines()

    def test_says_how_far_it_is_and_passes_on_what_steps_say(self):
        is_built, lines = self.run_build("program")
        self.assertTrue(is_built)
        self.assertEqual(lines[0], "Building 1 program: 0 of 2, nearly done")
        self.assertIn("a remark", lines)
        self.assertRegex(lines[-1], r"^Building 1 program: 2 of 2, done in \d s$")
        self.assertEqual(self.run_build("program"), (True, ["Building 1 program: nothing to do"]))

    def test_a_fault_is_shown_whole(self):
        is_built, lines = self.run_build("broken")
        self.assertFalse(is_built)
        self.assertTrue({str(i) for i in range(1, 501)} | {"last words"} <= set(lines))
        self.assertIn("FAILED: broken ", lines)

    def test_a_target_that_is_not_there(self):
        is_built, lines = self.run_build("progam")
        self.assertFalse(is_built)
        self.assertRegex(lines[0], "unknown target 'progam'")

    def test_a_terminal_gets_one_line_that_changes(self):
        mine, its = pty.openpty()
        code = subprocess.run([sys.executable, build.__file__, self.folder, "program"], stdout=its).returncode
        said = os.read(mine, 65536).decode()
        os.close(its)
        os.close(mine)
        self.assertEqual(code, 0)
        self.assertIn("\rBuilding: 0 of 2, nearly done\033[K\r", said)
        self.assertRegex(said, r"\r\033\[KBuilding: 2 of 2, done in \d s\r\n$")

    def test_a_step_counts_as_what_it_took_the_last_time(self):
        (self.folder / ".ninja_log").write_text(
            "# ninja log v5\n0\t500000\t0\tlarge.o\tabc\n500000\t501000\t0\tsmall.o\tabc\n")
        estimate = build.Estimate(self.folder, ["Building CXX object large.o", "Building CXX object small.o"])
        self.assertAlmostEqual(estimate.left_s(), 501 / os.cpu_count(), delta=1)
        estimate.finish("Building CXX object large.o")
        self.assertLess(estimate.left_s(), 1)

    def test_a_step_that_was_never_done_counts_by_what_it_includes(self):
        parts = [self.folder / "a.cpp", self.folder / "b.cpp"]
        parts[0].write_text("#include <vector>\n#include <string>\n")
        parts[1].write_text("#include <vector>\n#include <map>\n")
        unity = self.folder / "unity_0_cxx.cxx"
        unity.write_text("".join(f'#include "{part}"\n' for part in parts))
        (self.folder / "compile_commands.json").write_text(
            f'[{{"file": "{unity}", "command": "g++ -o x/large.o -c {unity}"}}]')
        estimate = build.Estimate(self.folder, ["Building CXX object x/large.o", "Linking CXX static library x.a"])
        work_s = build.OBJECT + 5 * build.PER_INCLUDED + build.OTHER
        self.assertAlmostEqual(estimate.left_s(), work_s / os.cpu_count(), delta=0.2)

    def test_times_are_said_roughly(self):
        self.assertEqual([build.say_left(s) for s in (200, 90, 89, 12, 9, -5)],
                         ["about 3 min left", "about 2 min left", "about 90 s left", "about 10 s left",
                          "nearly done", "nearly done"])
        self.assertEqual([build.say_took(s) for s in (59.4, 59.6, 252)], ["59 s", "1 min 0 s", "4 min 12 s"])


if __name__ == "__main__":
    unittest.main()
