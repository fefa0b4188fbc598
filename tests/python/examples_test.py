"""Runs the examples of deploy/python in short form and looks at what they print.

Usage: examples_test.py NAME. The exit code is 5 where a module is missing that only an example needs.
"""

import importlib.util
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(os.environ["TROCAR_ROOT"])


def run(name, *arguments):
    """What an example prints; it must succeed."""
    done = subprocess.run([sys.executable, "-B", ROOT / "deploy/python" / f"{name}.py", *map(str, arguments)],
                          capture_output=True, text=True)
    if done.returncode != 0:
        raise AssertionError(f"{name}: exit code {done.returncode}: {done.stderr}")
    return done.stdout


def needs(module):
    if importlib.util.find_spec(module) is None:
        raise unittest.SkipTest(f"{module} is missing: install python3-{module}")


class ExamplesTest(unittest.TestCase):
    def test_press_curve(self):
        rows = re.findall(r"^ *(\S+) mm +(\S+) N$", run("press_curve", "--steps", 2), re.M)
        forces = {float(depth): float(force) for depth, force in rows}
        self.assertEqual(sorted(forces), [-5, -4, -3, -2, -1, 0, 1, 2])
        self.assertEqual(forces[-5], 0)
        self.assertGreater(forces[2], forces[1])

    def test_cut_and_measure(self):
        nodes, force = re.match(r"(\d+) nodes made, at most (\S+) N", run("cut_and_measure", "--length", 0.02)).groups()
        self.assertGreater(int(nodes), 0)
        self.assertGreater(float(force), 0)

    def test_batch(self):
        rows = re.findall(r"(\S+) Pa +(\S+) N", run("batch", 3000, 6000))
        self.assertEqual([row[0] for row in rows], ["3000", "6000"])
        self.assertGreater(float(rows[1][1]), float(rows[0][1]))

    def test_fit_material(self):
        modulus, error = map(float, re.search(r"(\d+) Pa, standard error (\d+) Pa", run("fit_material")).groups())
        with tempfile.TemporaryDirectory() as folder:
            scenes = ROOT / "deploy/scenes"
            said = subprocess.run([os.environ["TROCAR_ORGAN"], "fit", scenes / "stretch.toml", scenes / "stretch.csv",
                                   "--out", folder], check=True, capture_output=True, text=True).stdout
        program = float(re.search(r"young_modulus_pa +(\S+) \+-", said).group(1))
        # Both minimise the same sum of squares, and end before a step is large beside what is uncertain.
        self.assertLess(abs(modulus - program), 0.1 * error)

    def test_read_recording(self):
        needs("pandas")
        with tempfile.TemporaryDirectory() as folder:
            recording = pathlib.Path(folder) / "feel.mcap"
            subprocess.run([os.environ["TROCAR_SIM"], ROOT / "tests/python/feel.toml", "--journal", recording,
                            "--out", folder], check=True, stdout=subprocess.DEVNULL)
            self.assertRegex(run("read_recording", recording), r"(?s)N, frame by frame.* mean .* max\ntool *\n0 +\d")

    def test_learn(self):
        # A few policies for short episodes: they learn little, and the same in every run.
        for task, iterations, population, gain in (("reach", 2, 12, 1), ("press", 1, 8, 10)):
            said = run("learn", task, "--iterations", iterations, "--population", population, "--episodes", 1,
                       "--tests", 2, "--seconds", 0.6)
            before, after = (float(re.search(f"{word}: return (\\S+)", said).group(1)) for word in ("before", "after"))
            self.assertGreater(after, before + gain)

    def test_gym_speed(self):
        rows = run("gym_speed", "--steps", 5, "--threads", 2).splitlines()
        self.assertEqual(len(rows), 2)
        hashes = [re.fullmatch(r"\d+ nodes, \d threads?: \d+ steps/s, .* times real time a core, .* in touch, "
                               r"state hash (\w{16})", row).group(1) for row in rows]
        self.assertEqual(hashes[0], hashes[1])

    def test_plots(self):
        needs("matplotlib")
        with tempfile.TemporaryDirectory() as folder:
            for name, arguments in (("press_curve", ("--steps", 1)), ("fit_material", ())):
                picture = pathlib.Path(folder) / f"{name}.svg"
                run(name, *arguments, "--plot", picture)
                self.assertIn("<svg", picture.read_text())


if __name__ == "__main__":
    program = unittest.main(argv=[sys.argv[0], f"ExamplesTest.test_{sys.argv[1]}"], exit=False, verbosity=2)
    if not program.result.wasSuccessful():
        sys.exit(1)
    sys.exit(5 if program.result.skipped else 0)
