"""Several environments at once, one thread each: the engine runs without Python's lock, so they share all cores."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np


def _stack(observations):
    if isinstance(observations[0], dict):
        return {key: np.stack([one[key] for one in observations]) for key in observations[0]}
    return np.stack(observations)


class VectorEnv:
    """Steps environments together; one that is over begins anew by itself.

    `make`: functions that give an environment each, all with equal spaces. Observations are stacked: an array of
    (environments x ...), or a dict of them. What a step returns for one that was over: the first observation of its
    new episode; the last one of the old is in its info as "final_observation", as is "final_info"."""

    def __init__(self, make):
        self.envs = [one() for one in make]
        if not self.envs:
            raise ValueError("make: must have at least one function")
        self.num_envs = len(self.envs)
        self.action_space, self.observation_space = self.envs[0].action_space, self.envs[0].observation_space
        self._pool = ThreadPoolExecutor(self.num_envs)

    def reset(self, *, seed=None, options=None):
        """Begins all; environment i with seed + i. Returns stacked observations and a list of infos."""
        seeds = [None if seed is None else seed + i for i in range(self.num_envs)]
        both = list(self._pool.map(lambda env, one: env.reset(seed=one, options=options), self.envs, seeds))
        return _stack([observation for observation, _ in both]), [info for _, info in both]

    def step(self, actions):
        """Steps all; `actions`: (environments x numbers). Returns stacked observations, rewards, float64, terminated
        and truncated, bool, and a list of infos. Raises ValueError where there are not as many actions."""
        if len(actions) != self.num_envs:
            raise ValueError(f"actions: has {len(actions)} rows, must have {self.num_envs}")
        results = list(self._pool.map(self._step, self.envs, actions))
        observations, rewards, terminated, truncated, infos = zip(*results)
        return _stack(observations), np.array(rewards), np.array(terminated), np.array(truncated), list(infos)

    @staticmethod
    def _step(env, action):
        observation, reward, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            last, last_info = observation, info
            observation, info = env.reset()
            info = {**info, "final_observation": last, "final_info": last_info}
        return observation, reward, terminated, truncated, info

    def close(self):
        """Ends all of them and their threads."""
        self._pool.shutdown()
        for env in self.envs:
            env.close()
