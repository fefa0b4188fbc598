"""Tests of trocar.scene: what other programs read of the files is what the recording has.

meshio reads the .vtu files. USD text is read by a reader of its own here, which knows its grammar and not the writer.
"""

import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree

import numpy as np
import recordings
import trocar
from trocar import scene

try:
    import meshio
except ImportError:
    meshio = None


class UsdReader:
    """Prims of a USD text by path: a dict of attributes, each a value or a dict of time to value. Strict: text that is
    not of the grammar that it knows is an error."""

    TOKEN = re.compile(r'\s*(?:(?P<text>"[^"\n]*")|(?P<number>-?\d+(?:\.\d+)?(?:e[-+]?\d+)?)'
                       r'|(?P<word>[A-Za-z_][\w.:]*(?:\[\])?)|(?P<sign>[(){}\[\],=:]))')

    def __init__(self, text):
        if not text.startswith("#usda 1.0\n"):
            raise ValueError("does not begin with #usda 1.0")
        self._tokens, at = [], len("#usda 1.0\n")
        text = text.rstrip()
        while at < len(text):
            match = self.TOKEN.match(text, at)
            if not match:
                raise ValueError(f"no token: {text[at:at + 40]!r}")
            self._tokens.append((match.lastgroup, match.group(match.lastgroup)))
            at = match.end()
        self._at = 0
        self.prims, self.kinds = {}, {}
        self._take("(")
        self.layer = self._fields(")")
        while self._at < len(self._tokens):
            self._prim("")

    def _next(self):
        self._at += 1
        return self._tokens[self._at - 1]

    def _peek(self):
        return self._tokens[self._at][1]

    def _take(self, word):
        kind, token = self._next()
        if token != word:
            raise ValueError(f"{token!r} stands where {word!r} has to")

    def _fields(self, end):
        fields = {}
        while self._peek() != end:
            name = self._next()[1]
            self._take("=")
            fields[name] = self._value()
        self._take(end)
        return fields

    def _value(self):
        kind, token = self._next()
        if kind == "number":
            return float(token)
        if kind == "text":
            return token[1:-1]
        ends = {"(": ")", "[": "]"}
        if token not in ends:
            raise ValueError(f"{token!r} is no value")
        values = []
        while self._peek() != ends[token]:
            values.append(self._value())
            if self._peek() != ends[token]:
                self._take(",")
        self._next()
        return values

    def _samples(self):
        samples = {}
        self._take("{")
        while self._peek() != "}":
            kind, time = self._next()
            if kind != "number" or float(time) in samples:
                raise ValueError(f"{time!r} is no time, or one that was there")
            self._take(":")
            samples[float(time)] = self._value()
            if self._peek() != "}":
                self._take(",")
        self._next()
        return samples

    def _prim(self, parent):
        self._take("def")
        kind, path = self._next()[1], f"{parent}/{self._next()[1][1:-1]}"
        if path in self.prims:
            raise ValueError(f"{path} is there twice")
        attributes = self.prims[path] = {}
        self.kinds[path] = kind
        self._take("{")
        while self._peek() != "}":
            if self._peek() == "def":
                self._prim(path)
                continue
            words = []
            while self._peek() != "=":
                words.append(self._next()[1])
            self._take("=")
            name = words[-1]
            if name.endswith(".timeSamples"):
                attributes[name[:-len(".timeSamples")]] = self._samples()
            else:
                attributes[name] = self._value()
        self._next()


class SceneTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.work = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.work.name)
        cls.path = recordings.record("cut", cls.folder)
        with trocar.Recording(cls.path) as recording:
            cls.frames = list(recording.frames())
            cls.tools = recording.tools()

    @classmethod
    def tearDownClass(cls):
        cls.work.cleanup()

    def program(self, *arguments):
        return subprocess.run([sys.executable, "-B", "-m", "trocar.scene", *map(str, arguments)], capture_output=True,
                              text=True)

    def test_usd_has_the_surface_of_every_frame(self):
        out = self.folder / "cut.usda"
        said = self.program(self.path, out)
        self.assertEqual(said.stdout, f"{out}: {len(self.frames)} moments\n", said.stderr)
        usd = UsdReader(out.read_text())
        self.assertEqual(usd.layer["upAxis"], "Y")
        self.assertEqual((usd.layer["startTimeCode"], usd.layer["endTimeCode"]), (1, len(self.frames)))
        meshes = [path for path, kind in usd.kinds.items() if kind == "Mesh"]
        changes = sum(not np.array_equal(a.triangles, b.triangles) for a, b in zip(self.frames, self.frames[1:]))
        self.assertGreater(changes, 1)
        self.assertEqual(len(meshes), changes + 1)
        for frame in self.frames:
            time = frame.tick / 16
            shown = []
            for path in meshes:
                samples = usd.prims[path]["visibility"]
                before = [at for at in samples if at <= time]
                if samples[max(before) if before else min(samples)] == "inherited":
                    shown.append(usd.prims[path])
            self.assertEqual(len(shown), 1, f"at {time}")
            mesh = shown[0]
            self.assertEqual(mesh["faceVertexCounts"], [3] * len(frame.triangles))
            np.testing.assert_array_equal(mesh["faceVertexIndices"], frame.triangles.ravel())
            np.testing.assert_allclose(mesh["points"][time], frame.positions, atol=1e-6)
            low, high = mesh["extent"]
            self.assertTrue((frame.positions >= np.array(low) - 1e-6).all())
            self.assertTrue((frame.positions <= np.array(high) + 1e-6).all())
        tool = usd.prims["/scene/tool_0"]
        last = self.tools["tick"][-1] / 16
        np.testing.assert_allclose(tool["xformOp:translate"][last], [self.tools[k][-1] for k in (
            "x_m", "y_m", "z_m")], atol=1e-6)
        np.testing.assert_allclose(tool["xformOp:orient"][last], [self.tools[k][-1] for k in (
            "qw", "qx", "qy", "qz")], atol=1e-6)
        self.assertIn("/scene/tool_0/rod", usd.prims)

    def test_a_part_and_a_moment(self):
        out = self.folder / "part.usda"
        self.assertEqual(self.program(self.path, out, "--from", 0.1, "--to", 0.3, "--every", 3).returncode, 0)
        times = sorted(time for prim in UsdReader(out.read_text()).prims.values() for time in prim.get("points", ()))
        expected = [f.tick for f in self.frames if 100 <= f.tick <= 300][::3]
        self.assertEqual([16 * time for time in times], expected)
        self.assertEqual(self.program(self.path, out, "--at", 0.2).returncode, 0)
        usd = UsdReader(out.read_text())
        self.assertEqual(list(usd.prims["/scene/tissue_0"]["points"]), [12])
        self.assertEqual(usd.prims["/scene/tissue_0"]["visibility"], {12: "inherited"})

    @unittest.skipIf(meshio is None, "meshio is missing: install python3-meshio")
    def test_paraview_series_is_read_by_meshio(self):
        out = self.folder / "series.pvd"
        self.assertEqual(self.program(self.path, out, "--every", 5).returncode, 0)
        sets = ElementTree.parse(out).getroot().findall("Collection/DataSet")
        frames = self.frames[::5]
        self.assertEqual(len(sets), 2 * len(frames))
        for number, frame in enumerate(frames):
            surface, tools = sets[2 * number:2 * number + 2]
            self.assertEqual(float(surface.get("timestep")), frame.tick / 1000)
            mesh = meshio.read(self.folder / surface.get("file"))
            np.testing.assert_array_equal(mesh.points, frame.positions)
            np.testing.assert_array_equal(mesh.cells_dict["triangle"], frame.triangles)
            rods = meshio.read(self.folder / tools.get("file"))
            rows = np.flatnonzero(self.tools["tick"] == frame.tick)
            np.testing.assert_array_equal(rods.points[:, 0], self.tools["x_m"][rows])
            np.testing.assert_array_equal(rods.point_data["force_n"][:, 0], self.tools["fx_n"][rows])

    @unittest.skipIf(meshio is None, "meshio is missing: install python3-meshio")
    def test_tets_with_data_of_cells(self):
        session = trocar.Session(trocar.Organ("plate"))
        out = self.folder / "tets.vtu"
        numbers = np.arange(len(session.tets), dtype=float)
        scene.write_vtu(out, session.positions, session.tets, cell_data={"number": numbers})
        mesh = meshio.read(out)
        np.testing.assert_array_equal(mesh.cells_dict["tetra"], session.tets)
        np.testing.assert_array_equal(mesh.cell_data_dict["number"]["tetra"], numbers)

    def test_what_cannot_be_written_is_a_line(self):
        for arguments, text in (
                ((self.path, "scene.obj"), "scene.obj: ends in neither .usda nor .pvd"),
                ((self.path, "scene.usda", "--every", 0), "--every: is 0, must be 1 or more"),
                ((self.path, "scene.usda", "--from", 3, "--to", 2),
                 "--from, --to: must be 0 or more, and --to not before --from"),
                ((self.path, self.folder / "late.usda", "--from", 30), "late.usda: there is no moment to write"),
                (("missing.mcap", "scene.usda"), "missing.mcap")):
            done = self.program(*arguments)
            self.assertEqual(done.returncode, 1)
            self.assertRegex(done.stderr, f"^trocar.scene: .*{re.escape(text)}")
            self.assertEqual(done.stderr.count("\n"), 1)
        self.assertFalse((self.folder / "late.usda").exists() or (self.folder / "late.usda.part").exists())


if __name__ == "__main__":
    unittest.main()
