"""Tests of the module trocar: equal bits with trocar-sim, and an exception for every misuse."""

import os
import pathlib
import signal
import subprocess
import tempfile
import threading
import unittest

import numpy as np
import stubs
import trocar

SCENES = pathlib.Path(os.environ["TROCAR_ROOT"]) / "deploy/scenes"


def put_on_top(session, organ, depth_m):
    """Presses the node of the greatest z along z; depth_m is inward, m."""
    top = organ.nodes[organ.nodes[:, 2].argmax()]
    session.put(0, top - [0, 0, depth_m], shaft=(0, 0, 1))


class PartsTest(unittest.TestCase):
    def test_a_grasper_draws_a_part_out_of_its_bed(self):
        organ = trocar.Organ(str(SCENES / "bed.toml"))
        self.assertEqual(set(organ.regions), {"liver", "gallbladder"})
        self.assertEqual(sum(len(nodes) for nodes in organ.regions.values()), len(organ.nodes))
        places = organ.ties["gallbladder-liver"]
        self.assertEqual(places.shape[1:], (2, 3))
        self.assertLess(np.linalg.norm(places[:, 1] - places[:, 0], axis=1).max(), 6e-3)
        session = trocar.Session(organ)
        session.step(1)
        self.assertEqual(session.counts()["ties"], len(places))
        part = organ.nodes[organ.regions["gallbladder"]]
        fundus = part[part[:, 0].argmax()]
        session.put(0, fundus, "grasp", shaft=(0, 1, 0))
        session.step(150)
        for i in range(150):
            session.put(0, fundus + [0, 4e-4 * i, 0], "grasp", shaft=(0, 1, 0))
            session.step(4)
        counts = session.counts()
        self.assertLess(counts["ties"], len(places) - 20)
        self.assertEqual(counts["edits"], 0)


class ScenarioTest(unittest.TestCase):
    def test_hashes_and_recording_are_those_of_trocar_sim(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "pull.mcap"
            subprocess.run([os.environ["TROCAR_SIM"], SCENES / "pull.toml", "--journal", path,
                            "--out", folder], check=True, stdout=subprocess.DEVNULL)
            result = trocar.Scenario(SCENES / "pull.toml").run()
            with trocar.Recording(path) as recording:
                hashes = recording.tick_hashes()
                self.assertGreater(len(hashes), 1000)
                np.testing.assert_array_equal(hashes, result.tick_hashes[:len(hashes)])
                frames = list(recording.frames())
                self.assertEqual([f.tick for f in frames], list(range(16, 1489, 16)))
                at = recording.seek(777)
                self.assertEqual(at.tick, 768)
                np.testing.assert_array_equal(at.positions, frames[47].positions)
                self.assertEqual(recording.organ().hash, result.organ.hash)
            for call in (recording.events, recording.tools, lambda: recording.last_tick):
                self.assertRaisesRegex(ValueError, "closed", call)
            cut = pathlib.Path(folder) / "cut.mcap"  # before the organ's end
            cut.write_bytes(path.read_bytes()[:1000])
            self.assertRaisesRegex(trocar.Error, "no organ; the recording ended too early", trocar.Recording, cut)
        self.assertEqual(result.values["middle_displacement"].shape, (75, 3))

    def test_tools_of_a_recording_are_columns(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "feel.mcap"
            scene = pathlib.Path(__file__).with_name("feel.toml")
            subprocess.run([os.environ["TROCAR_SIM"], scene, "--journal", path, "--out", folder], check=True,
                           stdout=subprocess.DEVNULL)
            with trocar.Recording(path) as recording:
                columns = recording.tools()
        self.assertEqual({len(column) for column in columns.values()}, {len(columns["tick"])})
        self.assertEqual(set(columns["verb"]), {"push"})
        self.assertEqual(columns["fy_n"][0], 0)
        self.assertGreater(columns["fy_n"][-1], 0)  # of the tissue: outward

    def test_errors_name_the_line(self):
        with self.assertRaises(trocar.Error) as caught:
            trocar.Scenario.parse("[organ]\nsource = \"block\"\nspaced = 1\n", "x.toml")
        self.assertIn("x.toml:3", str(caught.exception))
        self.assertNotIn("\n", str(caught.exception))

    def test_a_callback_ends_a_run(self):
        scenario = trocar.Scenario(SCENES / "pull.toml")
        self.assertRaises(ZeroDivisionError, lambda: scenario.run(callback=lambda t: 1 / 0))
        self.assertRaises(ValueError, lambda: scenario.run(solver="quick"))
        self.assertRaises(ValueError, lambda: scenario.run(threads=0))


class SessionTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.organ = trocar.Organ("elastic-liver")

    def test_a_restored_session_goes_on_to_the_bit(self):
        first = trocar.Session(self.organ)
        put_on_top(first, self.organ, -0.01)
        first.step(50)
        put_on_top(first, self.organ, 0.005)
        first.step(27)
        state = first.save()
        second = trocar.Session(self.organ, threads=2)
        second.restore(state)
        for session in (first, second):
            session.step(60)
        self.assertEqual(first.state_hash(), second.state_hash())
        self.assertGreater(first.force()[2], 0)  # of the tissue: outward

    def test_views_show_steps_and_outlive_the_session(self):
        session = trocar.Session(self.organ)
        positions = session.positions
        before = positions.copy()
        put_on_top(session, self.organ, -0.01)
        session.step(50)
        put_on_top(session, self.organ, 0.005)
        session.step(50)
        self.assertFalse(np.array_equal(before, positions))
        del session
        self.assertTrue(np.isfinite(positions).all())
        with self.assertRaises(ValueError):
            positions[0] = 1

    def test_a_cut_leaves_old_views_as_they_were(self):
        organ = trocar.Organ("plate")
        session = trocar.Session(organ)
        session.take(0, form="scalpel", radius=0.001)
        session.put(0, (-0.02, 0.03, 0), "none")
        session.step(20)
        old = session.positions
        for x in np.linspace(-0.02, 0.02, 100):
            session.put(0, (x, -0.006, 0), "cut")
            session.step(8)
        new = session.positions
        self.assertEqual(len(old), len(organ.nodes))
        self.assertGreater(len(new), len(old))
        self.assertTrue(np.isfinite(old).all() and np.isfinite(new).all())

    def test_misuse_is_refused(self):
        session = trocar.Session(self.organ)
        for error, call in (
                (trocar.Error, lambda: session.restore(b"x")),
                (TypeError, lambda: session.restore("x")),
                (ValueError, lambda: session.put(16, (0, 0, 0))),
                (ValueError, lambda: session.put(0, (0, 0))),
                (ValueError, lambda: session.put(0, np.zeros((3, 3)))),
                (ValueError, lambda: session.put(0, "abc")),
                (ValueError, lambda: session.put(0, (0, float("nan"), 0))),
                (ValueError, lambda: session.put(0, (0, 0, 0), "poke")),
                (ValueError, lambda: session.put(0, (0, 0, 0), shaft=(0, 0, 0))),
                (ValueError, lambda: session.force(0, tool=2)),
                (trocar.Error, lambda: session.take(0, radius=float("nan"))),
                (ValueError, lambda: session.step(-1)),
                (TypeError, lambda: session.step(1, callback=3)),
                (trocar.Error, lambda: session.step(1, callback=lambda tick: session.step())),
                (TypeError, lambda: trocar.Session(None)),
                (trocar.Error, lambda: trocar.Organ("no such organ")),
                (trocar.Error, lambda: trocar.Recording("no such file"))):
            with self.assertRaises(error) as caught:
                call()
            if error is not TypeError:
                self.assertNotIn("\n", str(caught.exception))

    def test_ctrl_c_ends_a_step(self):
        session = trocar.Session(self.organ)
        timer = threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGINT))
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            session.step(1_000_000)
        ticks = session.tick
        self.assertGreater(ticks, 0)
        session.step()
        self.assertEqual(session.tick, ticks + 1)


class StubsTest(unittest.TestCase):
    def test_stubs_are_those_of_the_module(self):
        path = pathlib.Path(os.environ["TROCAR_ROOT"]) / "server/python/trocar/__init__.pyi"
        self.assertEqual(path.read_text(), stubs.stubs())


class OrganTest(unittest.TestCase):
    def test_a_saved_organ_is_the_same(self):
        organ = trocar.Organ("plate")
        self.assertAlmostEqual(organ.volume, 0.160 * 0.004 * 0.160, places=9)
        self.assertAlmostEqual(organ.mass, 900 * organ.volume, places=9)
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "plate.organ"
            organ.save(path)
            again = trocar.Organ(str(path))
        self.assertEqual(organ.hash, again.hash)
        np.testing.assert_array_equal(organ.tets, again.tets)
        nodes = organ.nodes
        del organ
        self.assertEqual(nodes.shape, (1282, 3))
        with self.assertRaises(ValueError):
            nodes[0] = 0


if __name__ == "__main__":
    unittest.main()
