"""What a change reaches, on a small repository made for the test."""

import json
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "deploy/lib"))
from checks.plan import Plan  # noqa: E402


def target(folders, needs=(), sources=()):
    return {"folders": list(folders), "sources": list(sources), "needs": list(needs), "lone_headers": False}


def test(name, targets, **more):
    return {"name": name, "kind": "gtest", "command": [name], "targets": list(targets), **more}


class Reach(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        root = Path(folder.name)
        for name, text in {"tests/wire/wire_test.cpp": '#include "tests/support/random.h"\n',
                           "tests/support/random.h": '#include "tests/numbers/numbers.h"\n',
                           "tests/numbers/numbers.h": ""}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text)
        targets = {
            "base": target(["common/base"]),
            "wire": target(["common/wire"], ["base"]),
            "server": target(["server/app"], ["wire"]),
            "base_test": target(["tests/base"], ["base"]),
            "wire_test": target(["tests/wire"], ["wire"], ["tests/wire/wire_test.cpp"]),
            "e2e_test": target(["tests/e2e"], ["server"]),
        }
        tests = [test("base_test", ["base_test"]), test("wire_test", ["wire_test"]),
                 test("e2e_test", ["e2e_test"], reads=["deploy/scenes"]),
                 test("style", [], reads=["."]), test("options", ["server"], reads=["docs", "deploy"]),
                 test("page", [], after=["recording"], reads=["page"]), test("recording", [], reads=["none"])]
        (root / "tests.json").write_text(json.dumps({"targets": targets, "tests": tests}))
        self.plan = Plan(root, root)

    def reached(self, *files):
        return self.plan.reached_by(list(files))[0]

    def test_a_library_reaches_who_links_it_and_who_starts_a_program_of_it(self):
        self.assertEqual(self.reached("common/wire/framing.cpp"), ["e2e_test", "options", "style", "wire_test"])
        self.assertEqual(self.reached("common/base/result.h"),
                         ["base_test", "e2e_test", "options", "style", "wire_test"])

    def test_a_header_of_tests_reaches_who_includes_it_by_another(self):
        self.assertEqual(self.reached("tests/numbers/numbers.h"), ["style", "wire_test"])

    def test_a_file_in_a_folder_below_belongs_to_the_folder(self):
        self.assertEqual(self.reached("tests/e2e/hands/lift.toml"), ["e2e_test", "style"])

    def test_a_file_that_is_read_reaches_its_readers(self):
        self.assertEqual(self.reached("deploy/scenes/lift.toml"), ["e2e_test", "options", "style"])
        self.assertEqual(self.reached("docs/limits.md"), ["options", "style"])

    def test_what_belongs_to_nothing_reaches_everything(self):
        tests, why = self.plan.reached_by(["Makefile", "docs/limits.md"])
        self.assertEqual(len(tests), 7)
        self.assertEqual(why, ["Makefile"])

    def test_how_things_are_built_reaches_everything_though_a_test_reads_it(self):
        self.assertEqual(len(self.reached("deploy/cmake/project_test.cmake")), 7)

    def test_a_test_brings_what_it_begins_with(self):
        self.assertEqual(self.reached("page/index.html"), ["page", "recording", "style"])

    def test_no_change_reaches_nothing(self):
        self.assertEqual(self.reached(), [])


if __name__ == "__main__":
    unittest.main()
