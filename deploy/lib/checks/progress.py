"""A line that says how far tests are; on a terminal it changes, elsewhere a new one comes now and then."""

import sys
import threading
import time

PERIOD_S = 15  # between two lines where there is no terminal


class Progress:
    def __init__(self, tests: int, cost: float, workers: int, stream=sys.stdout):
        self.tests, self.cost, self.workers, self.stream = tests, cost, workers, stream
        self.ended = self.failed = 0
        self._cost_done = 0.0
        self._begin = self._said = time.monotonic()
        self._lock = threading.Lock()

    def test_ended(self, program: str, result, cost: float) -> None:
        from .runner import shown  # which uses this module
        with self._lock:
            self.ended += 1
            self._cost_done += cost
            if result.outcome == "failed":
                self.failed += 1
                self._clear()
                name = result.name if result.name.startswith(program) else f"{program}.{result.name}"
                print(f"FAILED: {name} ({result.seconds:.1f} s)\n{shown(result)}\n", file=self.stream, flush=True)
            now = time.monotonic()
            if self.stream.isatty():
                self._clear()
                print(self.line(now), end="\r", file=self.stream, flush=True)
            elif now - self._said >= PERIOD_S:
                self._said = now
                print(self.line(now), file=self.stream, flush=True)

    def test_is_tried_again(self, name: str) -> None:
        with self._lock:
            self.tests += 1
            self._clear()
            print(f"trying again, by itself: {name}", file=self.stream, flush=True)

    def line(self, now: float) -> str:
        text = f"test {self.ended:,} of {self.tests:,}"
        if self.failed:
            text += f", {self.failed} failed"
        return f"{text}, about {minutes(self.seconds_left(now))} left"

    def seconds_left(self, now: float) -> float:
        """From what tests are expected to take, corrected by what they have taken so far."""
        left = (self.cost - self._cost_done) / self.workers
        elapsed = now - self._begin
        # The first tests say little about the machine.
        trust = min(1.0, self._cost_done / (0.1 * self.cost)) if self.cost else 0
        speed = elapsed * self.workers / self._cost_done if self._cost_done else 1
        return left * (trust * speed + (1 - trust))

    def _clear(self) -> None:
        if self.stream.isatty():
            print("\r\033[K", end="", file=self.stream)


def minutes(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 55 else f"{seconds / 60:.0f} min"
