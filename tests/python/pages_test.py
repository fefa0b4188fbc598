"""Runs the first lines of the book's pages about Python, as somebody does who copies them."""

import os
import pathlib
import re
import subprocess
import sys
import tempfile
import textwrap
import unittest

DOCS = pathlib.Path(os.environ["TROCAR_ROOT"]) / "docs"


def first_lines(page, begin="import"):
    """The first block of code that begins with an import, or with something else."""
    blocks = re.findall(r"(?:^    .*\n|^\n(?=    ))+", (DOCS / page).read_text(), re.MULTILINE)
    return next(block for block in map(textwrap.dedent, blocks) if block.lstrip().startswith(begin))


class PagesTest(unittest.TestCase):
    def run_page(self, page, lines, files=()):
        code = first_lines(page).strip()
        self.assertEqual(len(code.splitlines()), lines)
        with tempfile.TemporaryDirectory() as folder:
            for name, begin in files:
                (pathlib.Path(folder) / name).write_text(first_lines(page, begin))
            done = subprocess.run([sys.executable, "-B", "-c", code], cwd=folder, capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)
            return done.stdout, sorted(path.name for path in pathlib.Path(folder).iterdir())

    def test_python(self):
        said, _ = self.run_page("python.md", 9)
        self.assertRegex(said, r"^\[.*\] N \d+\n$")

    def test_learning(self):
        said, _ = self.run_page("learning.md", 10)
        self.assertRegex(said, r"^-?\d+\.\d+ \d\.\d+ N True\n$")

    def test_scenes(self):
        _, files = self.run_page("scenes.md", 10)
        self.assertEqual(files, ["pressed", "pressed.pvd", "pressed.usda"])

    def test_parts(self):
        said, _ = self.run_page("parts-and-ties.md", 6, [("lid.toml", "[[part]]")])
        self.assertRegex(said, r"^\d+ \(\d+, 2, 3\)\n\d+\n$")


if __name__ == "__main__":
    unittest.main()
