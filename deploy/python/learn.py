"""Learns to reach, or to press to a force, by the cross-entropy method: numpy alone, two cores, minutes.

    python3 learn.py reach
    python3 learn.py press --iterations 20 --out policy.npz

Each iteration draws weights of a small policy from a normal distribution, runs each on the same episodes, and fits the
distribution to the best fifth. Before and after, the mean return over episodes of fixed seeds is printed. Equal
options give equal numbers.
"""

import argparse
import time
from concurrent.futures import ThreadPoolExecutor

import numpy

import trocar.gym

TEST_SEEDS = range(1000, 1008)


def reach(weights, state):
    """Along each axis by a gain of how far the point is, and a part that is always there."""
    return numpy.tanh(weights[:3] * state["goal"] / 0.02 + weights[3:])


def press(weights, state):
    """Along the normal by five weights of what is felt and asked for, and aside by one of how far aside the tip is."""
    away, normal, asked = state["goal"][:3], state["goal"][3:6], state["goal"][6]
    force = state["force"][0] @ normal
    outside = -(away @ normal)
    error = numpy.clip((force - asked) / asked, -2, 2)
    along = weights[:5] @ [1, error, abs(error), force > 0, numpy.clip(outside / 0.01, -1, 1)]
    aside = away + outside * normal
    return numpy.clip(along * normal + weights[5] * aside / 0.005, -1, 1)


POLICIES = {"reach": ("trocar/Reach-v0", reach, 6), "press": ("trocar/Press-v0", press, 6)}


def run(env, policy, weights, seed):
    """The return of an episode."""
    state, _ = env.reset(seed=seed)
    total, is_over = 0.0, False
    while not is_over:
        state, reward, terminated, truncated, _ = env.step(policy(weights, state))
        total, is_over = total + reward, terminated or truncated
    return total


class Learner:
    """A policy's distribution, and an environment for each thread."""

    def __init__(self, task, threads, seed, seconds):
        name, self.policy, count = POLICIES[task]
        self._envs = [trocar.gym.make(name, seconds=seconds) for _ in range(threads)]
        self._pool = ThreadPoolExecutor(threads)
        self._random = numpy.random.default_rng(seed)
        self.mean, self.deviation = numpy.zeros(count), numpy.ones(count)

    def returns(self, candidates, seeds):
        """The mean return of each, over episodes of these seeds; the threads share the candidates."""
        def share(number):
            env = self._envs[number]
            return [numpy.mean([run(env, self.policy, weights, seed) for seed in seeds])
                    for weights in candidates[number::len(self._envs)]]

        out = numpy.empty(len(candidates))
        for number, part in enumerate(self._pool.map(share, range(len(self._envs)))):
            out[number::len(self._envs)] = part
        return out

    def improve(self, population, seeds):
        """One iteration; returns the mean return of the best fifth."""
        candidates = self.mean + self.deviation * self._random.normal(size=(population, len(self.mean)))
        returns = self.returns(candidates, seeds)
        best = candidates[numpy.argsort(-returns, kind="stable")[:max(2, population // 5)]]
        self.mean = best.mean(axis=0)
        self.deviation = best.std(axis=0) + 0.02
        return numpy.sort(returns)[-len(best):].mean()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("task", choices=sorted(POLICIES))
    parser.add_argument("--iterations", type=int, default=10, help="[10]")
    parser.add_argument("--population", type=int, default=20, help="policies an iteration [20]")
    parser.add_argument("--episodes", type=int, default=2, help="for each policy [2]")
    parser.add_argument("--tests", type=int, default=len(TEST_SEEDS), help="episodes before and after [8]")
    parser.add_argument("--seconds", type=float, default=2.0, help="simulated time of an episode [2]")
    parser.add_argument("--threads", type=int, default=2, help="[2]")
    parser.add_argument("--seed", type=int, default=0, help="[0]")
    parser.add_argument("--out", metavar="FILE", help="writes the weights (.npz)")
    options = parser.parse_args()
    learner = Learner(options.task, options.threads, options.seed, options.seconds)
    tests = list(TEST_SEEDS)[:options.tests]
    begin = time.monotonic()
    print(f"before: return {learner.returns([learner.mean], tests)[0]:.2f}", flush=True)
    for iteration in range(options.iterations):
        # Other episodes each time, equal ones for all policies of an iteration.
        seeds = range(iteration * options.episodes, (iteration + 1) * options.episodes)
        print(f"iteration {iteration + 1}: best fifth {learner.improve(options.population, seeds):.2f}", flush=True)
    print(f"after: return {learner.returns([learner.mean], tests)[0]:.2f}")
    print(f"{time.monotonic() - begin:.0f} s")
    if options.out:
        numpy.savez(options.out, weights=learner.mean)


if __name__ == "__main__":
    main()
