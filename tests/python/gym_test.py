"""Tests of trocar.gym: seeds, spaces, refusals, tasks that scripted hands do, lessons, several at once."""

import pathlib
import subprocess
import sys
import tempfile
import textwrap
import tomllib
import unittest

import numpy as np
import trocar
from trocar import gym, picture
from trocar.gym import scripted
from trocar.gym.base import INSTRUMENTS


def play(env, hand, seed):
    """Rewards of an episode, whether it was done, and the last info."""
    state, _ = env.reset(seed=seed)
    rewards, is_over = [], False
    while not is_over:
        state, reward, terminated, truncated, info = env.step(hand(state))
        rewards.append(reward)
        is_over = terminated or truncated
    return rewards, terminated, info


def digest(env, seed, steps=6):
    """All that an episode of random actions gives, as bytes."""
    state, info = env.reset(seed=seed)
    random = np.random.default_rng(seed)
    out = [gym.flatten(state).tobytes(), info["state_hash"]]
    for _ in range(steps):
        action = random.uniform(-1, 1, env.action_space.shape)
        state, reward, terminated, truncated, info = env.step(action)
        out += [gym.flatten(state).tobytes(), reward, terminated, truncated, info["state_hash"]]
    return out


class InstrumentsTest(unittest.TestCase):
    def test_they_are_those_of_the_programs(self):
        table = pathlib.Path(__file__).parents[2] / "common/tool/instruments.toml"
        known = {one["name"]: one for one in tomllib.loads(table.read_text())["instrument"]}
        keys = {"radius": ("radius_mm", 1e-3), "reach": ("reach_mm", 1e-3), "edge": ("edge_mm", 1e-3),
                "grip": ("grip_n", 1), "friction": ("friction", 1)}
        for name in ("probe", "grasper", "scalpel"):
            _, shape = INSTRUMENTS[name]
            self.assertEqual(shape["form"], known[name]["form"])
            for key, (said, unit) in keys.items():
                if key in shape:
                    self.assertAlmostEqual(shape[key], known[name].get(said, 0) * unit, msg=f"{name}.{key}")


class SeedTest(unittest.TestCase):
    def test_equal_seeds_give_equal_bits_in_every_task(self):
        for name in gym.TASKS:
            with self.subTest(name):
                env = gym.make(name)
                self.assertEqual(digest(env, 3, 2), digest(env, 3, 2))
                # What it takes and gives is of its spaces.
                state, _ = env.reset(seed=0)
                self.assertTrue(env.observation_space.contains(state))
                env.action_space.seed(1)
                action = env.action_space.sample()
                self.assertTrue(env.action_space.contains(action))
                state, reward, terminated, truncated, info = env.step(action)
                self.assertTrue(env.observation_space.contains(state))
                self.assertEqual([type(one) for one in (reward, terminated, truncated)], [float, bool, bool])
                self.assertEqual(info["tick"], 2 * gym.TICKS)

    def test_a_new_task_gives_the_bits_of_one_that_was_used(self):
        for name in ("trocar/CutLine-v0", "trocar/FindTheLump-v0"):
            used = gym.make(name)
            other = digest(used, 4)
            self.assertEqual(digest(used, 3), digest(gym.make(name), 3))
            self.assertNotEqual(digest(used, 3), other)

    def test_threads_beside_it_change_nothing(self):
        env = gym.make("trocar/Press-v0")
        alone = [digest(env, seed, 0)[0] for seed in (5, 6)]
        both = gym.VectorEnv([lambda: gym.make("trocar/Press-v0")] * 2)
        observations, _ = both.reset(seed=5)
        for i in range(2):
            self.assertEqual(gym.flatten({key: value[i] for key, value in observations.items()}).tobytes(), alone[i])
        both.close()


class InterfaceTest(unittest.TestCase):
    def test_a_picture_shows_tissue_and_tool(self):
        env = gym.make("trocar/Press-v0", observation="picture", render_mode="rgb_array", size=(80, 60))
        seen, _ = env.reset(seed=0)
        self.assertTrue(env.observation_space.contains(seen))
        np.testing.assert_array_equal(seen, env.render())
        red = (seen[:, :, 0].astype(int) - seen[:, :, 2] > 30).mean()
        grey = ((np.ptp(seen.astype(int), axis=2) < 30) & (seen[:, :, 0] > 40)).mean()
        self.assertGreater(red, 0.1)
        self.assertGreater(grey, 0.001)
        self.assertIsNone(gym.make("trocar/Press-v0").render())

    def test_an_episode_is_truncated_and_has_to_begin(self):
        env = gym.make("trocar/Reach-v0", seconds=0.032)
        with self.assertRaisesRegex(ValueError, r"^action: no episode is on, call reset\(\) first$"):
            env.step([0, 0, 0])
        env.reset(seed=0)
        self.assertEqual(env.step([0, 0, 0])[2:4], (False, False))
        self.assertEqual(env.step([0, 0, 0])[2:4], (False, True))
        self.assertRaises(ValueError, env.step, [0, 0, 0])

    def test_what_cannot_be_is_refused_in_a_line(self):
        env = gym.make("trocar/Lift-v0")
        env.reset(seed=0)
        for text, call in (
                ("action: number 1 is not finite, each must be -1 to 1", lambda: env.step([0, np.nan, 0, 0])),
                ("action: number 2 is 1.5, each must be -1 to 1", lambda: env.step([0, 0, 1.5, 0])),
                (r"action: has shape \(3,\), must have \(4,\)", lambda: env.step([0, 0, 0])),
                ("action: must be 4 numbers", lambda: env.step("left")),
                ("seed: is -1, must be None or a whole number of 0 or more", lambda: env.reset(seed=-1)),
                ("options: has 'goal', this task has none", lambda: env.reset(options={"goal": 1})),
                ("observation: is 'sound', must be 'state' or 'picture'", lambda: gym.Press(observation="sound")),
                ("render_mode: is 'human', must be None or 'rgb_array'", lambda: gym.Press(render_mode="human")),
                ("seconds: is 0, must be 0.016 to 3600 s", lambda: gym.Press(seconds=0)),
                ("width: is 4, must be 8 to 2048 pixels", lambda: gym.Press(observation="picture", size=(4, 9)).reset()),
                ("name: there is no 'trocar/Suture-v0', take one of trocar/Reach-v0", lambda: gym.make(
                    "trocar/Suture-v0"))):
            with self.subTest(text), self.assertRaisesRegex(ValueError, "^" + text):
                call()
        env.step(np.zeros(4))  # what was refused changes nothing


class HandTest(unittest.TestCase):
    def test_scripted_hands_do_their_tasks(self):
        for name, make in scripted.HANDS.items():
            with self.subTest(name):
                rewards, is_done, info = play(gym.make(name), make(), seed=2)
                self.assertTrue(is_done, info)
                self.assertTrue(info["is_success"])
                self.assertGreater(sum(rewards[-1:]), 5)


class LessonTest(unittest.TestCase):
    def test_points_of_a_lesson_are_those_of_its_course(self):
        env = gym.make("trocar/FollowThePoint-v0")

        def follow(state):
            away = state["goal"][:3] / 0.001
            return np.append(np.clip(away, -1, 1), [-1, -1])

        rewards, is_done, info = play(env, follow, seed=1)
        self.assertTrue(is_done and info["is_success"])
        self.assertGreater(info["points"], 80)
        # Ten for each of two stages' progress but for their last steps, and a tenth of their points.
        self.assertAlmostEqual(sum(rewards), 20 + 2 * info["points"] / 10, delta=0.5)

    def test_a_ring_is_carried_to_its_peg(self):
        env = gym.make("trocar/MoveTheRings-v0")
        state, _ = env.reset(seed=0)
        total = 0.0
        # Where tool 0 goes, mm, whether its jaws are closed, and how many steps it waits there.
        for place, use, wait in (((-33, 40, 0), -1, 0), ((-33, 4.5, 0), -1, 10), ((-33, 4.5, 0), 1, 40),
                                 ((-33, 40, 0), 1, 0), ((15, 40, 0), 1, 0), ((15, 4.5, 0), 1, 10),
                                 ((15, 4.5, 0), -1, 40), ((15, 40, 0), -1, 50)):
            while wait >= 0:
                away = np.array(place) / 1000 - state["pose"][0, :3]
                action = np.concatenate([np.clip(0.7 * away / 0.001, -0.7, 0.7), [use, 0, 0, 0, -1, -1]])
                state, reward, _, _, info = env.step(action)
                total += reward
                wait -= np.linalg.norm(away) < 0.001
        self.assertEqual(info["stage"], 1)
        result, = env.session.course()["results"]
        self.assertTrue(result["is_reached"])
        self.assertEqual(result["measures"]["drops"], 0)
        self.assertAlmostEqual(total, 10 + result["points"] / 10, delta=0.3)

    def test_an_answer_is_told(self):
        env = gym.make("trocar/FindTheLump-v0")
        env.reset(seed=1)
        say = np.array([0, 0, 0, -1, 1])
        self.assertEqual(env.step(say)[4]["answer"], "no tissue")
        self.assertIsNone(env.step(say)[4]["answer"])  # it is still being said

    def test_a_lesson_of_a_file_and_its_mistakes(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "hold.toml"
            path.write_text('title = "T"\ntext = "t"\norgan = "plate"\n[[stage]]\nname = "S"\ntext = "t"\n'
                            'goal = "hold"\nlimit_s = 1\n')
            with self.assertRaisesRegex(ValueError, "^tools: say which instruments"):
                gym.LessonTask(lesson=str(path))
            env = gym.LessonTask(lesson=str(path), tools=("grasper",))
            _, is_done, info = play(env, lambda state: np.zeros(5), seed=0)
            self.assertTrue(is_done)  # the stage's time is over
            self.assertFalse(info["is_success"])
            path.write_text("title = 3\n")
            self.assertRaisesRegex(trocar.Error, "hold.toml", trocar.Lesson, str(path))
        self.assertEqual(len(trocar.lessons()), 7)


class VectorTest(unittest.TestCase):
    def test_one_that_is_over_begins_anew(self):
        both = gym.VectorEnv([lambda: gym.make("trocar/Reach-v0", seconds=0.016)] * 2)
        both.reset(seed=1)
        observations, rewards, terminated, truncated, infos = both.step(np.zeros((2, 3)))
        self.assertEqual(observations["pose"].shape, (2, 1, 7))
        self.assertEqual(rewards.shape, (2,))
        self.assertEqual(truncated.tolist(), [True, True])
        self.assertIn("final_observation", infos[0])
        self.assertEqual(infos[0]["tick"], gym.TICKS)
        self.assertRaisesRegex(ValueError, "^actions: has 1 rows, must have 2$", both.step, np.zeros((1, 3)))
        both.close()


class GymnasiumTest(unittest.TestCase):
    def test_tasks_are_of_gymnasium_where_it_is_installed(self):
        # A stand-in: what the module takes from it.
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder) / "gymnasium"
            (root / "envs").mkdir(parents=True)
            spaces = pathlib.Path(gym.__file__).with_name("spaces.py").read_text()
            (root / "spaces.py").write_text(spaces)
            (root / "__init__.py").write_text("from gymnasium.spaces import Env\n")
            (root / "envs/__init__.py").touch()
            (root / "envs/registration.py").write_text(
                "known = {}\ndef register(id, entry_point):\n    known[id] = entry_point\n")
            code = textwrap.dedent("""
                import gymnasium, trocar.gym
                from gymnasium.envs.registration import known
                assert set(known) == set(trocar.gym.TASKS)
                env = known["trocar/Press-v0"](seconds=1)
                assert isinstance(env, gymnasium.Env) and isinstance(env.action_space, gymnasium.spaces.Box)
                """)
            subprocess.run([sys.executable, "-B", "-c", code], check=True,
                           env={"PYTHONPATH": f"{folder}:{pathlib.Path(trocar.__file__).parent.parent}"})


class PictureTest(unittest.TestCase):
    def test_the_nearer_of_two_triangles_is_seen(self):
        corners = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], float)
        positions = np.concatenate([corners, corners + [0, 0, 0.5]])
        seen = picture.draw(positions, [[0, 1, 2], [3, 4, 5]], [(250, 0, 0), (0, 250, 0)], eye=(0, 0, 3),
                            look_at=(0, 0, 0), width=32, height=32)
        self.assertGreater(seen[16, 16, 1], 200)
        self.assertEqual(seen[16, 16, 0], 0)
        self.assertEqual(tuple(seen[0, 0]), picture.GROUND)
        np.testing.assert_array_equal(  # from behind there is nothing to see
            picture.draw(positions, [[0, 1, 2]], [(250, 0, 0)], eye=(0, 0, -3), look_at=(0, 0, 0), width=8, height=8),
            np.broadcast_to(np.uint8(picture.GROUND), (8, 8, 3)))


if __name__ == "__main__":
    unittest.main()
