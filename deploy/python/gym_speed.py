"""Prints how many steps a second a task makes, and how many times real time that is for each core.

A probe presses the liver and comes back, again and again, in an environment for each thread. Steps a second are by the
clock, so run it on an idle machine; times of real time are by the CPU time of each thread.
"""

import argparse
import time
from concurrent.futures import ThreadPoolExecutor

import numpy

import trocar.gym


def work(env, steps):
    """Returns how many steps had a force, the last state hash, and the CPU time, s."""
    env.reset(seed=0)
    touches, begin = 0, time.thread_time()
    for step in range(steps):
        state, _, terminated, truncated, info = env.step([0, 0, -0.9 if step % 40 < 20 else 0.9])
        touches += bool(state["force"].any())
        if terminated or truncated:
            env.reset()
    return touches, info["state_hash"], time.thread_time() - begin


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", default="trocar/Press-v0", choices=("trocar/Press-v0", "trocar/Reach-v0"))
    parser.add_argument("--organ", help="built-in organ or file [the task's own]")
    parser.add_argument("--steps", type=int, default=500, help="of 16 ms, each environment [500]")
    parser.add_argument("--threads", type=int, default=2, help="the most [2]")
    options = parser.parse_args()
    for threads in range(1, options.threads + 1):
        envs = [trocar.gym.make(options.task, organ=options.organ, seconds=3600) for _ in range(threads)]
        with ThreadPoolExecutor(threads) as pool:
            begin = time.monotonic()
            results = list(pool.map(lambda env: work(env, options.steps), envs))
            seconds = time.monotonic() - begin
        steps = threads * options.steps
        print(f"{len(envs[0].organ.nodes)} nodes, {threads} thread{'s' * (threads > 1)}: {steps / seconds:.0f} steps/s, "
              f"{steps * trocar.gym.STEP_S / sum(spent for _, _, spent in results):.1f} times real time a core, "
              f"{numpy.mean([touches for touches, _, _ in results]) / options.steps:.0%} in touch, "
              f"state hash {results[0][1]:016x}")


if __name__ == "__main__":
    main()
