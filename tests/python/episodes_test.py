"""Tests of trocar.episodes: files of episodes, read back by numpy, h5py and pandas, and what strain is."""

import importlib.util
import json
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

import numpy as np
import recordings
import trocar
from trocar import episodes, gym, parquet
from trocar.gym import scripted


def program(*arguments):
    return subprocess.run([sys.executable, "-B", "-m", "trocar.episodes", *map(str, arguments)], capture_output=True,
                          text=True)


def has(module):
    return importlib.util.find_spec(module) is not None


class EpisodesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.work = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.work.name)
        env = gym.make("trocar/Press-v0", seconds=0.5, render_mode="rgb_array", size=(32, 24))
        cls.expected = [episodes.run(env, scripted.press, seed, has_picture=True) for seed in (7, 8)]

    @classmethod
    def tearDownClass(cls):
        cls.work.cleanup()

    def make(self, name, *arguments):
        out = self.folder / name
        done = program("make", "trocar/Press-v0", out, "--episodes", 2, "--seed", 7, "--seconds", 0.5, "--pictures",
                       "--width", 32, "--height", 24, *arguments)
        self.assertEqual(done.returncode, 0, done.stderr)
        steps = sum(len(one["action"]) for one in self.expected)
        self.assertRegex(done.stdout, f"{name}: 2 episodes, {steps} steps, [0-2] done\n")
        return out

    def test_npz_has_what_an_episode_gave(self):
        out = self.make("npz")
        for number, expected in enumerate(self.expected):
            with np.load(out / f"episode_{number:06d}.npz") as file:
                self.assertEqual(set(file), set(expected))
                for key in file:
                    np.testing.assert_array_equal(file[key], expected[key])
        steps = len(expected["action"])
        for key, shape in (("pose", (1, 7)), ("force", (1, 3)), ("counts", (4,)), ("strain", (2,)),
                           ("picture", (24, 32, 3)), ("tick", ()), ("state_hash", ())):
            self.assertEqual(expected[key].shape, (steps + 1, *shape))
        self.assertEqual(expected["state_hash"].dtype, np.uint64)
        np.testing.assert_array_equal(np.diff(expected["tick"]), 16)
        self.assertGreater(np.linalg.norm(expected["force"]), 0)

    @unittest.skipUnless(has("h5py"), "h5py is missing: install python3-h5py")
    def test_hdf5_has_them_as_robomimic_does(self):
        import h5py
        out = self.folder / "episodes.hdf5"
        episodes.write_hdf5(out, self.expected, "trocar/Press-v0")
        with h5py.File(out, "r") as file:
            for number, expected in enumerate(self.expected):
                group = file[f"data/demo_{number}"]
                self.assertEqual(group.attrs["num_samples"], len(expected["action"]))
                np.testing.assert_array_equal(group["actions"], expected["action"])
                np.testing.assert_array_equal(group["obs/force"], expected["force"])
                np.testing.assert_array_equal(group["obs/state_hash"], expected["state_hash"])

    def test_a_data_set_of_lerobot(self):
        out = self.make("lerobot", "--format", "lerobot")
        info = json.loads((out / "meta/info.json").read_text())
        lengths = [len(one["action"]) for one in self.expected]
        self.assertEqual((info["total_episodes"], info["total_frames"], info["fps"]), (2, sum(lengths), 62.5))
        lines = {name: [json.loads(line) for line in (out / f"meta/{name}.jsonl").read_text().splitlines()]
                 for name in ("tasks", "episodes", "episodes_stats")}
        self.assertEqual([row["length"] for row in lines["episodes"]], lengths)
        self.assertEqual(lines["tasks"], [{"task_index": 0, "task": "trocar/Press-v0"}])
        self.assertEqual(info["features"]["observation.image"]["shape"], [24, 32, 3])
        for number, expected in enumerate(self.expected):
            path = out / info["data_path"].format(episode_chunk=0, episode_index=number)
            data = path.read_bytes()
            size, = struct.unpack("<I", data[-8:-4])
            self.assertEqual((data[:4], data[-4:]), (b"PAR1", b"PAR1"))
            for key in info["features"]:
                self.assertIn(key.encode(), data[-8 - size:])
            self.assertIn(expected["action"].astype("<f4").tobytes(), data)
            self.assertEqual(data.count(b"\x89PNG\r\n\x1a\n"), lengths[number])
            stats = lines["episodes_stats"][number]["stats"]["action"]
            np.testing.assert_allclose(stats["max"], expected["action"].max(axis=0))
            if has("pyarrow") or has("fastparquet"):
                import pandas
                table = pandas.read_parquet(path)
                np.testing.assert_array_equal(np.stack(table["action"]), expected["action"])

    def test_a_table_of_parquet_is_these_bytes(self):
        path = self.folder / "table.parquet"
        parquet.write(path, {"k": np.array([1, 2]), "v": np.array([[1, 2, 3], [4, 5, 6]], np.float32), "s": ["a", "b"]})
        # As hyparquet 1.x read them: k 1 and 2; v [1, 2, 3] and [4, 5, 6]; s a and b.
        self.assertEqual(path.read_bytes().hex(), PARQUET)

    def test_a_recording_has_forces_and_hashes_of_its_frames(self):
        recorded = recordings.record("cut", self.folder)
        out = self.folder / "cut.npz"
        done = program("export", recorded, out)
        self.assertEqual(done.returncode, 0, done.stderr)
        with trocar.Recording(recorded) as recording, np.load(out) as file:
            frames, tools = list(recording.frames()), recording.tools()
            self.assertEqual(file["tick"].tolist(), [frame.tick for frame in frames])
            self.assertEqual(file["counts"].tolist(), [[len(f.positions), len(f.triangles)] for f in frames])
            self.assertGreater(file["counts"][-1, 1], file["counts"][0, 1])
            np.testing.assert_array_equal(file["state_hash"], recording.tick_hashes()[file["tick"] - recording.ticks()[0]])
            np.testing.assert_array_equal(file["force"][-1, 0], [tools[key][-1] for key in ("fx_n", "fy_n", "fz_n")])
            np.testing.assert_array_equal(file["pose"][-1, 0, :3], [tools[key][-1] for key in ("x_m", "y_m", "z_m")])

    def test_what_cannot_be_is_a_line(self):
        for arguments, text in ((("make", "trocar/Press-v0", self.folder), "is there already, take another name"),
                                (("make", "trocar/Press-v0", "x", "--episodes", "0"), "--episodes: is 0, must be 1"),
                                (("export", "missing.mcap", "x.csv"), "x.csv: ends in neither .npz nor .hdf5"),
                                (("export", "missing.mcap", "x.npz"), "missing.mcap")):
            done = program(*arguments)
            self.assertEqual(done.returncode, 1)
            self.assertIn(text, done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1)


class StrainTest(unittest.TestCase):
    def test_a_stretched_tet_has_the_strain_of_its_stretch(self):
        rest = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
        turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]], float)
        now = rest @ np.diag([1.2, 0.9, 1.0]) @ turn + 5
        np.testing.assert_allclose(episodes.principal_strain(rest, now, [[0, 1, 2, 3]]), 0.5 * (1.2**2 - 1))
        random = np.random.default_rng(1)
        before, after = (rest + random.uniform(-0.2, 0.2, (4, 3)) for _ in range(2))
        gradient = (np.linalg.inv(before[1:] - before[0]) @ (after[1:] - after[0])).T
        expected = np.linalg.eigvalsh(0.5 * (gradient.T @ gradient - np.eye(3)))[-1]
        np.testing.assert_allclose(episodes.principal_strain(before, after, [[0, 1, 2, 3]]), expected)
        self.assertEqual(episodes.principal_strain(rest, rest, [[0, 1, 2, 3]]), 0)


PARQUET = (
    "504152311500152015202c15041500150615060000010000000000000002000000000000001500155415542c150c15001506"
    "15060000080000000200040102000401020000000c010000803f0000004000004040000080400000a0400000c04015001514"
    "15142c15041500150615060000010000006101000000621502196c4806736368656d611506001504250018016b0035001801"
    "761502150600350418046c697374150200150825001807656c656d656e7400150c25001801732500001604191c193c26081c"
    "1504192500061918016b150016041642164226080000264a1c15081925000619380176046c69737407656c656d656e741500"
    "160c16761676264a000026c0011c150c1925000619180173150016041636163626c001000016ee01160400280674726f6361"
    "7200b300000050415231")

if __name__ == "__main__":
    unittest.main()
